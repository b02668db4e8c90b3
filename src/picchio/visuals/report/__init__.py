"""Reports: one HTML file each that can be read, printed and mailed."""
