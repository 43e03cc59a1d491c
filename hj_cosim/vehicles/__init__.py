"""Pure models: the bicycle, IDM, MOBIL, RSS distances, the road frame."""
