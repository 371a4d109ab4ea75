#!/usr/bin/python3
"""Groups that wrap edges: a block in a corner, a hexagonal shaft in its hole."""
import assembly_case

assembly_case.main("edges")
