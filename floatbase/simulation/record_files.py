"""Records in files: a run as arrays and a header in an npz file, without pickle."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from floatbase._files import file_errors, open_file, whole_file
from floatbase._validation import Array, Value, as_instance, read_only
from floatbase.dynamics import Contacts, LinearConstraint
from floatbase.errors import FloatbaseError, InputError, SimulationWarning, warn
from floatbase.robots import Robot, State
from floatbase.simulation.ground import Ground

if TYPE_CHECKING:
    from floatbase.simulation.record import Rollout

_FORMAT = "floatbase rollout 1"  # another number is another version of the format


def write_record(path: str | Path, run: Rollout) -> None:
    """Write a run to a file, whole or not at all."""
    values = {field.name: getattr(run, field.name) for field in fields(run)}
    arrays: dict[str, Any] = {
        name: value for name, value in values.items() if isinstance(value, np.ndarray)
    }
    stances = list(dict.fromkeys([run.contacts, *run.stances]))
    contacts = list(dict.fromkeys(contact for stance in stances for contact in stance))
    number = {one: i for group in (stances, contacts) for i, one in enumerate(group)}
    header = {name: value for name, value in values.items() if name not in arrays} | {
        "format": _FORMAT,
        "contacts": contacts,
        "stances": [[number[contact] for contact in stance] for stance in stances],
        "targets": list(run.targets),
    }
    arrays |= {f"target {name}": rows for name, rows in run.targets.items()}
    arrays["stance"] = np.array([number[stance] for stance in run.stances], dtype=int)
    text = json.dumps(header, default=_as_json)
    with (
        file_errors("path", path, "run.npz", "cannot be written to", "Pass another path."),
        whole_file(Path(os.path.expanduser(path)), keep_link=True) as part,
        part.open("wb") as file,
    ):
        np.savez_compressed(file, header=np.array(text), **arrays)


def read_record(path: str | Path, robot: Robot | None) -> dict[str, Any]:
    """Return the fields of a run that was written to a file."""
    with (
        file_errors("path", path, "run.npz", "cannot be read", "Pass the path of a saved run."),
        open(os.path.expanduser(path), "rb", opener=open_file) as file,
    ):
        try:
            with np.load(file, allow_pickle=False) as stored:
                arrays = dict(stored)
            header = str(arrays.pop("header"))
            if (found := json.loads(header)["format"]) != _FORMAT:
                raise InputError(
                    f"{path} has the format {found!r}, but this version of floatbase reads "
                    f"{_FORMAT!r}. Load the file with the version that saved it."
                )
            values = _rollout_fields(json.loads(header, object_hook=_from_json), arrays)
            _check_shapes(path, values)
        except (OSError, InputError):
            raise
        except Exception as error:  # NumPy, zipfile, zlib and json raise many kinds
            raise InputError(
                f"{path} is damaged, or it is not a record of a run. Pass the path of a file that "
                f"Rollout.save has written."
            ) from error
    recorded = values["robot"]
    if robot is None:
        return values
    as_instance("robot", robot, Robot)
    if (recorded.nq, recorded.joint_names) != (robot.nq, robot.joint_names):
        raise InputError(
            f"{path} is a record of {recorded!r} with the joints {', '.join(recorded.joint_names)}."
            f" {robot!r} has other joints. Pass a robot with these joints, or omit robot."
        )
    return values | {"robot": robot}


def _rollout_fields(header: dict[str, Any], arrays: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a run from the header and the arrays of a file."""
    del header["format"]
    contacts, number = header["contacts"], arrays.pop("stance")
    stances = [Contacts([contacts[i] for i in members]) for members in header["stances"]]
    targets = {name: read_only(arrays.pop(f"target {name}")) for name in header["targets"]}
    return {
        **header,
        **{name: read_only(rows) for name, rows in arrays.items()},
        "contacts": stances[0],
        "stances": tuple(stances[i] for i in number),
        "pushes": tuple(header["pushes"]),
        "targets": MappingProxyType(targets),
    }


def _check_shapes(path: str | Path, values: dict[str, Any]) -> None:
    """Raise `InputError` for an array that does not fit the robot, the contacts and the times."""
    robot, contacts, n = values["robot"], values["contacts"], len(values["time"])
    widths: dict[str, tuple[int, ...]] = {"time": (), "q": (robot.nq,), "v": (robot.nv,)}
    widths |= dict.fromkeys(("tau", "tau_desired"), (robot.d,))
    widths |= dict.fromkeys(("planned", "measured"), (contacts.k,))
    widths["foot_positions"] = (contacts.n_points, 3)
    for name, width in widths.items():
        if (shape := np.shape(values[name])) != (n, *width):
            raise InputError(
                f"{path} is damaged: {name} has the shape {shape}, but {n} rows of this robot have "
                f"the shape {(n, *width)}. Save the run again."
            )


def _as_json(value: Any) -> Any:
    """Convert a value of the package, an array or a path for JSON; `_from_json` is the inverse."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping | Path):
        return dict(value) if isinstance(value, Mapping) else str(value)
    known: Any = next((cls for cls in type(value).__mro__ if cls in _classes().values()), None)
    if isinstance(value, FloatbaseError):
        conflict = getattr(value, "constraints", ())
        return {"class": known.__name__, "text": str(value), "conflict": conflict}
    if known is None:
        raise InputError(
            f"A file cannot hold {type(value).__name__} {value.name!r}. Derive its class from "
            f"PointContact or another contact of fb.dynamics, or save run.table()."
        )
    names = [field.name for field in fields(known)] if is_dataclass(known) else value.__getstate__()
    entries = {name: getattr(value, name) for name in names}
    if isinstance(value, Robot):
        del entries["model"]
        entries |= {"floating": value.is_floating, "armature": value.model.armature}
    stored = {name: entry for name, entry in entries.items() if not callable(entry)}
    if known is not LinearConstraint and (len(stored) < len(entries) or type(value) is not known):
        warn(
            f"A file cannot hold the functions of {getattr(value, 'name', 'the ground')}. A loaded "
            f"run has a {known.__name__} at rest instead, with the exact recorded forces.",
            SimulationWarning,
        )
    return {"class": known.__name__, **stored}


def _from_json(entries: dict[str, Any]) -> Any:
    """Make the value that an object in the header stands for."""
    if "class" not in entries:
        return entries
    cls = _classes()[entries.pop("class")]
    if issubclass(cls, FloatbaseError):
        text, conflict = entries.values()
        return cls(text, *([conflict] if conflict else []))
    if cls is Robot:
        return _make_robot(**entries)
    if cls is LinearConstraint:
        entries["function"] = partial(_unknown_rows, entries["name"])
    return cls(*entries.values()) if cls is Ground else cls(**entries)


def _make_robot(name: str, urdf: str, floating: bool, armature: Array, **others: Any) -> Robot:
    """Make a robot from its entries in a file."""
    model = pin.buildModelFromXML(urdf, *([pin.JointModelFreeFlyer()] if floating else []))
    model.armature = np.array(armature)
    folders, feet = map(Path, others.pop("package_dirs")), others.pop("feet")
    return Robot(name, model, urdf, tuple(folders), tuple(feet), **others)


def _unknown_rows(name: str, state: State, t: float) -> tuple[Array, Array]:
    """Raise `InputError`, since files hold no functions."""
    raise InputError(
        f"The rows of {name!r} are unknown, because this run was loaded from a file, which holds "
        f"no functions. Use the contacts of the controller instead."
    )


def _classes() -> dict[str, Any]:
    """Return the classes of the package that a file may hold, by name."""
    found: list[type] = [*Value.__subclasses__(), FloatbaseError]
    for cls in found:  # which grows meanwhile
        found += cls.__subclasses__()
    return {cls.__name__: cls for cls in found if cls.__module__.startswith("floatbase.")}
