"""Table 2: how its lives follow from its stresses, without an arm and with one."""
