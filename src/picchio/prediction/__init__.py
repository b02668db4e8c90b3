"""What each sensor would have read; residual; noise floor."""
