"""Plans that ship with the package: `nonrigid bench demo` runs the first."""
