"""Where ROS 2 looks for others, read from its own environment variables.

    ROS_DOMAIN_ID                    0..232; empty or not set: 0
    ROS_LOCALHOST_ONLY=1             this computer alone (to Humble)
    ROS_AUTOMATIC_DISCOVERY_RANGE    LOCALHOST, SUBNET (as not set), SYSTEM_DEFAULT or OFF (from Iron)
    ROS_STATIC_PEERS                 addresses, separated by semicolons (from Iron)
    CYCLONEDDS_URI                   of Cyclone DDS itself: has the last word

Sources: rcl (``domain_id.c``, ``discovery_options.c``) and rmw_cyclonedds_cpp (how they become its configuration).
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

from cad.errors import ParameterError

MOST_DOMAIN = 232  # DDS: more leaves no ports
RANGES = ("LOCALHOST", "SUBNET", "SYSTEM_DEFAULT", "OFF")
NUMBER = re.compile(r"0[xX][0-9a-fA-F]{1,4}|0[0-7]{0,4}|[1-9][0-9]{0,3}", re.ASCII)
MOST_ON_ONE = 32  # participants of one computer that are looked for, as rmw_cyclonedds_cpp has it


def domain_id(given: int | None = None, environment: Mapping[str, str] = os.environ) -> int:
    """The domain: the one given, that of ``ROS_DOMAIN_ID`` (also hexadecimal, and octal with a leading 0), or 0.

    Raises:
        ParameterError: outside 0..232, or no number.
    """
    text = environment.get("ROS_DOMAIN_ID", "").strip() if given is None else str(given)
    if not text:
        return 0
    if NUMBER.fullmatch(text):
        base = 16 if text[:2] in ("0x", "0X") else 8 if text[0] == "0" else 10
        if (found := int(text, base)) <= MOST_DOMAIN:
            return found
    raise ParameterError(f"ROS_DOMAIN_ID={text} outside 0..{MOST_DOMAIN}", name="domain", value=text)


def dds_configuration(environment: Mapping[str, str] = os.environ) -> str | None:
    """Configuration of Cyclone DDS from ROS's variables; None where they are not set.

    Raises:
        ParameterError: a discovery range that ROS does not know.
    """
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if reach not in ("", *RANGES):
        raise ParameterError(
            f"ROS_AUTOMATIC_DISCOVERY_RANGE={reach}: choose {', '.join(RANGES)}, or leave it out", name="ros"
        )
    peers = [peer for peer in environment.get("ROS_STATIC_PEERS", "").split(";") if peer]
    if environment.get("ROS_LOCALHOST_ONLY") == "1":
        reach, peers = "LOCALHOST", []
    if reach in ("SYSTEM_DEFAULT", "OFF"):
        peers = []
    general = discovery = ""
    if reach == "LOCALHOST":  # with multicast for discovery: Fast DDS that starts later is not seen without
        general = '<Interfaces><NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces>'
        peers = ["localhost", *peers]
    if reach in ("LOCALHOST", "OFF"):
        general += f"<AllowMulticast>{'spdp' if reach == 'LOCALHOST' else 'false'}</AllowMulticast>"
        discovery = (
            f"<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{MOST_ON_ONE}</MaxAutoParticipantIndex>"
        )
    if peers:
        discovery += "<Peers>" + "".join(f"<Peer address={quoteattr(peer)}/>" for peer in peers) + "</Peers>"
    if not general + discovery:
        return None
    text = f"<CycloneDDS><Domain><General>{general}</General><Discovery>{discovery}</Discovery></Domain></CycloneDDS>"
    return ",".join(filter(None, (text, environment.get("CYCLONEDDS_URI", ""))))
