"""The verification report: ``python -m sensing.simulator.verification``. The runtime never imports it."""
