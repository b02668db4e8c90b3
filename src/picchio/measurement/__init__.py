"""What measured data are worth: their noise, and what is wrong with them."""
