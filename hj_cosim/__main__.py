"""`python -m hj_cosim` is `hj-cosim`."""

from hj_cosim.cli.entry import main

if __name__ == "__main__":
    main()
