"""The state of an endcap as diagnostic_msgs/DiagnosticStatus has it, for recordings and topics."""

from __future__ import annotations

from sensing.live.core.stats import EndcapHealth

MOST_DROPPED = 0.25  # E: share of frames over which a run is overloaded; a camera that is a little quick loses some

Diagnosis = tuple[str, int, str, dict[str, str]]  # name, level (0 OK, 1 WARN, 2 ERROR), message, values


def diagnosis(health: EndcapHealth) -> Diagnosis:
    """State, level, reason and counts of one endcap."""
    reasons, level = [health.message], health.level
    if health.valid and health.dropped_share > MOST_DROPPED:
        level = max(level, 1)
        reasons.append(f"{100 * health.dropped_share:.0f} % of frames dropped: lower rate_hz, or give more --workers")
    reason = "; ".join(filter(None, reasons))
    message = f"{health.status}: {reason}" if reason else health.status
    values = {
        "state": health.status,
        "valid": str(health.valid).lower(),
        "rate_hz": f"{health.rate_hz:.1f}",
        "dropped": str(health.dropped),
        "dropped_share": f"{health.dropped_share:.2f}",
        "unusable": str(health.faults),
        "reopened": str(health.reopened),
        "p50_ms": f"{health.p50_ms:.2f}",
        "p99_ms": f"{health.p99_ms:.2f}",
        "dots": f"{health.dots}/{health.dots_known}",
        "drift": health.drift,
        "zeroed": health.zeroed,
    }
    return health.endcap, level, message, values
