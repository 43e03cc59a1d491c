"""Which drivers mean harm, as far as their driving shows it, and what SPC makes of that."""
