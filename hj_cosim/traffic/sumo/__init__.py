"""Traffic by SUMO, through libsumo."""
