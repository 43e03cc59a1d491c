"""Optimistic planning (Hren & Munos 2008): the paper's OP and HJOP."""
