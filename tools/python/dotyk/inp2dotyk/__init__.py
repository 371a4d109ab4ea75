"""Scenes of dotyk from decks of CalculiX and Abaqus: the modules of dotyk.convert."""
