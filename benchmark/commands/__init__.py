"""The commands of `nonrigid`, one module each."""
