"""Presets of OrcaSlicer and Bambu Studio on which a project builds: their names, and which settings are not theirs.

Notes:
    These slicers read a project over their bare defaults, not over the presets that it names: a key that the project
    leaves out becomes the default (no printer model, so that a Bambu printer is not found for sending; accelerations
    and limits of no real printer). The entries of ``different_settings_to_system`` (process, filament, printer) turn
    that round: where a named preset is installed, every key that they do not list is taken from the preset (S,
    ``PresetCollection::load_external_preset``). A filament without the name of an installed preset is asked about
    when the project is opened.
"""

from __future__ import annotations

from collections.abc import Mapping

from fab.slice.filaments import Filament
from fab.slice.printers import Printer

Settings = Mapping[str, str | list[str]]
PRINTER_KEYS = frozenset(
    (
        "printable_area",
        "bed_exclude_area",
        "printable_height",
        "nozzle_diameter",
        "retraction_length",
        "machine_start_gcode",
        "machine_end_gcode",
        "before_layer_change_gcode",
        "use_relative_e_distances",
    )
)


def orca_type(filament: Filament) -> str:
    """Family of a filament as OrcaSlicer and Bambu Studio write it."""
    return "TPU" if filament.type == "FLEX" else filament.type


def orca_presets(own: Settings, printer: Printer, filament: Filament) -> Settings:
    """Names of the presets, and the keys that are not theirs; empty for a printer without presets.

    Args:
        own: settings of the project.
        printer: with the names of its presets.
        filament: of the project.
    """
    if not printer.orca_printer:
        return {}
    machine = sorted(set(own) & PRINTER_KEYS)
    spool = sorted(key for key, value in own.items() if isinstance(value, list) and key not in PRINTER_KEYS)
    process = sorted(set(own) - PRINTER_KEYS - set(spool))
    return {
        "printer_settings_id": printer.orca_printer,
        "print_settings_id": printer.orca_process,
        "filament_settings_id": [printer.orca_filament.replace("*", orca_type(filament))],
        "different_settings_to_system": [";".join(keys) for keys in (process, spool, machine)],
    }
