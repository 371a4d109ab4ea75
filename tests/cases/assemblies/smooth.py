#!/usr/bin/python3
"""geometry='smooth' where facets are faces, and mid nodes on chords."""
import assembly_case

assembly_case.main("smooth")
