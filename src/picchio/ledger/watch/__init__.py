"""What changed: readings of each shift, from ring-downs, drives and blows, against the first."""
