#!/usr/bin/python3
"""Bodies and faces that no contact pair names."""
import assembly_case

assembly_case.main("left out")
