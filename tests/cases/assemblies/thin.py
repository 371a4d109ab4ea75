#!/usr/bin/python3
"""Both faces of thin curved bodies in one group."""
import assembly_case

assembly_case.main("thin")
