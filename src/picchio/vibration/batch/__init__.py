"""The same in compiled code, for many poses or many variations."""
