"""Pictures of the deformed inner surface: ``python -m sensing.simulator.render``."""
