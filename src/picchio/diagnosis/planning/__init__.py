"""Which tests of stiffness narrow the life on a task most: `picchio plan`."""
