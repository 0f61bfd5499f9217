"""The state of an endcap as diagnostic_msgs/DiagnosticStatus has it, for recordings and topics."""

from __future__ import annotations

from sensing.live.core.stats import EndcapHealth

Diagnosis = tuple[str, int, str, dict[str, str]]  # name, level (0 OK, 1 WARN, 2 ERROR), message, values


def diagnosis(health: EndcapHealth) -> Diagnosis:
    """State, level, reason and counts of one endcap."""
    message = f"{health.status}: {health.message}" if health.message else health.status
    values = {
        "state": health.status,
        "valid": str(health.valid).lower(),
        "rate_hz": f"{health.rate_hz:.1f}",
        "dropped": str(health.dropped),
        "unusable": str(health.faults),
        "reopened": str(health.reopened),
        "p50_ms": f"{health.p50_ms:.2f}",
        "p99_ms": f"{health.p99_ms:.2f}",
        "dots": f"{health.dots}/{health.dots_known}",
        "drift": health.drift,
        "zeroed": health.zeroed,
    }
    return health.endcap, health.level, message, values
