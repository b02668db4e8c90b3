"""Quality of measured data: noise, and faults."""
