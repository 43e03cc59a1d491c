"""Pure models: the bicycle, IDM, MOBIL, RSS distances."""
