"""Effects that depend on the date or on the temperature."""
