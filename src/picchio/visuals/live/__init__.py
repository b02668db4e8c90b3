"""Live: the robot in a browser, answering while it is moved."""
