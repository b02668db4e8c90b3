"""The paper's figures, and those that show where it errs."""
