"""The 3-D scene: a robot, what shakes it and what that costs, in one offline HTML file."""
