"""Scripts to start from; `hj-cosim examples NAME > mine.py` makes one yours."""
