"""States of every shell from a few solved ones: units, library, labelled sets of any design and silicone."""
