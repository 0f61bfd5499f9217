"""Any ROS 2 message type over Cyclone DDS: types, names and hashes follow from the definitions that recordings use.

    writer = publisher(participant, "endcap_0/valid", ros.BOOL)
    writer.write(encoded(ros.BOOL, ros.boolean(True)))      # bytes of sensing.live.outputs.ros.types

Sources: the mapping of ROS 2 names to DDS (``rt/`` topics, ``rq/`` and ``rr/`` of services, ``dds_`` types), REP 2016
for the type hash (RIHS01), which Iron and later announce in the user data of each end.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from sensing.live.outputs.ros import types as ros

KEPT = 10  # ROS 2's default depth


@lru_cache(maxsize=64)
def idl_type(name: str) -> Any:
    """DDS type of a message type, for example ``geometry_msgs/msg/WrenchStamped``; its messages hold their bytes."""
    from cyclonedds.idl import make_idl_struct, types
    from rosbags.interfaces import Nodetype

    generic: Any = types

    def of(field: Any) -> Any:
        kind, rest = field
        if kind == Nodetype.NAME:
            return idl_type(rest)
        if kind == Nodetype.BASE:
            return _plain(rest[0])
        inner, length = rest
        return generic.array[of(inner), length] if kind == Nodetype.ARRAY else generic.sequence[of(inner)]

    package, folder, short = name.split("/")
    fields = {field: of(content) for field, content in ros.typestore().fielddefs[name][1]}
    made = make_idl_struct(short, f"{package}::{folder}::dds_::{short}_", fields)
    made.serialize = lambda self, *_, **__: self.cdr  # type: ignore[method-assign]
    return made


def _plain(name: str) -> Any:
    from cyclonedds.idl import types

    if name in ("string", "bool"):
        return {"string": str, "bool": bool}[name]
    return getattr(types, "byte" if name == "byte" else name)


def encoded(name: str, cdr: bytes) -> Any:
    """A message of a type, as a writer takes it.

    Args:
        name: of the type.
        cdr: its bytes, with their head of four.
    """
    kind = idl_type(name)
    message = kind.__new__(kind)
    message.cdr = cdr
    return message


def quality(name: str = "", latched: bool = False, kept: int = KEPT, reliable: bool = True) -> Any:
    """ROS 2's default: reliable, volatile, keep last; a slow subscriber never holds up the publisher.

    Args:
        name: type whose hash is announced; empty for a topic.
        latched: late subscribers get the last one (transient local, depth 1), as ``/tf_static`` has it.
        kept: messages that wait for a reader.
        reliable: False for best effort, which is what a reader must ask for to be connected to a publisher of best
            effort.
    """
    from cyclonedds.core import Policy, Qos
    from cyclonedds.util import duration

    policies = [
        Policy.Reliability.Reliable(duration(milliseconds=0)) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(1 if latched else kept),
    ]
    if name:
        policies.append(Policy.Userdata(f"typehash={ros.type_hash(name)};".encode()))
    return Qos(*policies)


def publisher(participant: Any, topic: str, name: str, latched: bool = False) -> Any:
    """A DDS writer of a ROS topic.

    Args:
        participant: of the domain.
        topic: name without the first slash.
        name: message type.
        latched: as above.
    """
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    kind, qos = idl_type(name), quality(latched=latched)
    return DataWriter(participant, Topic(participant, f"rt/{topic}", kind, qos=qos), qos=quality(name, latched))
