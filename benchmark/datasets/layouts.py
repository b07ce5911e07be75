"""Recognise the ways in which people lay out sets of matching problems, by their folders and file names alone.

| layout | meshes | ground truth |
| --- | --- | --- |
| `shrec16` | `null/<class>.off`, `<split>/<split>_<class>_shape_<n>.off` | beside: `.baryc_gt`, `.baryc_gt_sym` |
| `repacked` | the same names in `null/off`, `<split>/off` | `<split>/corres/*.vts`, mirrored: `corres_sym` |
| `maps` | `shapes/<any>.off` | `maps/<part>_<full>.map` |
| `vts` | `off/<class><n>.off` | `corres/<class><n>.vts`: vertices of the same row correspond |
| `posed` | `<class><n>.off`, `.vert` with `.tri`, or `.mat` | the same vertex number |

Nothing depends on how many classes, shapes or sets there are. A whole split without ground truth is a test set.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping

from nonrigid.benchmark.datasets.files import FileSource, Tree
from nonrigid.benchmark.datasets.problems import (
    Fault,
    Folder,
    Problem,
    Survey,
    first_of,
    folders_of,
    keep_complete,
    mesh_of,
    meshes_of,
)
from nonrigid.geometry.errors import InputError

_TRUTH_SUFFIXES = (".baryc_gt", ".vts", ".map")
_PARTIAL = re.compile(r"(?P<split>[^_]+)_(?P<class_name>.+)_shape_(?P<number>\d+)")
_POSED = re.compile(r"(?P<class_name>.*?)[_-]*(?P<number>\d+)")


def survey(tree: Tree, *, templates: Mapping[str, FileSource] | None = None) -> Survey:
    """Find every matching problem under a root, and every file that one of them lacks.

    Parameters
    ----------
    templates
        Full shapes by class, for a set that comes without them, as the SHREC'16 test set does.
    """
    folders = folders_of(tree)
    found = Survey()
    taken: set[str] = set()
    for find in (_partial_sets, _map_sets, _vts_sets, _posed_sets):
        for used in find(tree, folders, taken, found, dict(templates or {})):
            taken.add(used)
    return found


def template_folder(tree: Tree) -> dict[str, FileSource]:
    """Return the full shapes by class of the one folder `null` (or `null/off`) under a root.

    Raises
    ------
    InputError
        If there is none, or more than one.
    """
    homes = [place for place in folders_of(tree) if _is_null(place)]
    if len(homes) != 1:
        raise InputError(
            f"{len(homes)} folders `null` with full shapes, not 1", file=tree.root, remedy="name the folder that has it"
        )
    return meshes_of(folders_of(tree)[homes[0]])


def _partial_sets(
    tree: Tree, folders: Mapping[str, Folder], taken: set[str], found: Survey, given: Mapping[str, FileSource]
) -> Iterator[str]:
    """Find the layouts `shrec16` and `repacked`."""
    nulls = {_base(place): meshes_of(folder) for place, folder in folders.items() if _is_null(place)}
    for base, own in nulls.items():
        found.templates[tree.name_of(base)] = own
    # A test set has no folder null of its own; the one other set under this root that has one serves it.
    spare: Mapping[str, FileSource] = given or (next(iter(nulls.values())) if len(nulls) == 1 else {})
    yield from (place for place in folders if _is_null(place))
    prefixes = {match["split"] for folder in folders.values() for stem in folder if (match := _PARTIAL.fullmatch(stem))}
    for place, folder in folders.items():
        parts = {stem: match for stem in folder if (match := _PARTIAL.fullmatch(stem))}
        last = place.rpartition("/")[2]
        mapped = last == "shapes" and f"{_parent(place)}/maps".lstrip("/") in folders  # the layout `maps`
        if not parts or mapped or last in ("corres", "corres_sym", "maps"):
            continue
        packed = last == "off"
        home = _parent(place) if packed else place
        base = _parent(home)
        beside = {
            role: folders.get(f"{home}/{name}".lstrip("/"), {}) if packed else folder
            for role, name in (("truth", "corres"), ("mirrored", "corres_sym"))
        }
        shapes = spare if nulls.get(base) is None else nulls[base]
        split = home.rpartition("/")[2] or tree.name_of(base)
        parts |= {stem: match for stem in beside["truth"] if (match := _PARTIAL.fullmatch(stem))}
        problems = []
        for stem, match in sorted(parts.items(), key=lambda item: (item[1]["class_name"], int(item[1]["number"]))):
            if match["split"] != split and split in prefixes:
                found.faults.append(
                    Fault(
                        place=str(tree.place_of(f"{place}/{stem}")),
                        problem=f"a shape of {match['split']!r} among those of {split!r}",
                        remedy="move it to the folder it belongs to",
                    )
                )
            problems.append(
                Problem(
                    name=stem,
                    split=match["split"],
                    class_name=match["class_name"],
                    number=int(match["number"]),
                    archive=tree.name_of(base),
                    layout="repacked" if packed else "shrec16",
                    part=mesh_of(folder.get(stem, {})),
                    full=shapes.get(match["class_name"]),
                    truth=first_of(beside["truth"].get(stem, {}), _TRUTH_SUFFIXES),
                    mirrored=first_of(
                        beside["mirrored"].get(stem, {}), (".baryc_gt_sym", *(_TRUTH_SUFFIXES if packed else ()))
                    ),
                )
            )
        keep_complete(problems, found, tree, place, bool(shapes))
        source = folders.get(base, {}).get("source_poses", {}).get(".csv")
        if source is not None:
            found.poses[tree.name_of(base)] = source
            yield base
        yield from (place, f"{home}/corres", f"{home}/corres_sym")


def _map_sets(
    tree: Tree, folders: Mapping[str, Folder], taken: set[str], found: Survey, given: Mapping[str, FileSource]
) -> Iterator[str]:
    """Find the layout `maps`."""
    for place in [place for place in folders if place.rpartition("/")[2] == "maps" and place not in taken]:
        base = _parent(place)
        home = f"{base}/shapes".lstrip("/")
        shapes = meshes_of(folders.get(home, {}))
        fulls: dict[str, int] = defaultdict(int)
        problems = []
        for stem, files in sorted(folders[place].items(), key=lambda item: _natural(item[0])):
            if ".map" not in files:
                continue
            cuts = [at for at, letter in enumerate(stem) if letter == "_"]
            # Names may hold underscores themselves: the cut is where both sides are shapes.
            pairs = [(stem[:at], stem[at + 1 :]) for at in cuts]
            part, full = next((pair for pair in pairs if set(pair) <= set(shapes)), pairs[-1] if pairs else (stem, ""))
            fulls[full] += 1
            match = _PARTIAL.fullmatch(part)
            split, dash, class_name = full.partition("-")
            tail = re.search(r"\d+$", part)
            problems.append(
                Problem(
                    name=part if full in part or match else f"{part}_{full}",
                    split=match["split"] if match else split if dash else "all",
                    class_name=match["class_name"] if match else class_name or full,
                    number=int(match["number"]) if match else int(tail[0]) if tail else fulls[full],
                    archive=tree.name_of(base),
                    layout="maps",
                    part=shapes.get(part),
                    full=shapes.get(full),
                    truth=files[".map"],
                )
            )
        keep_complete(problems, found, tree, home, True)
        yield from (place, home)


def _vts_sets(
    tree: Tree, folders: Mapping[str, Folder], taken: set[str], found: Survey, given: Mapping[str, FileSource]
) -> Iterator[str]:
    """Find the layout `vts`: all shapes of a class to its first one."""
    for place in [place for place in folders if place.rpartition("/")[2] == "off" and place not in taken]:
        base = _parent(place)
        rows = folders.get(f"{base}/corres".lstrip("/"), {})
        vts = {stem: files[".vts"] for stem, files in rows.items() if ".vts" in files}
        problems = list(_class_pairs(tree, base, {**dict.fromkeys(vts), **meshes_of(folders[place])}, "vts", vts))
        keep_complete(problems, found, tree, place, True, always=True)
        yield from (place, f"{base}/corres".lstrip("/"))


def _posed_sets(
    tree: Tree, folders: Mapping[str, Folder], taken: set[str], found: Survey, given: Mapping[str, FileSource]
) -> Iterator[str]:
    """Find the layout `posed`: all poses of a class to its first one."""
    for place, folder in folders.items():
        if place in taken or not meshes_of(folder):
            continue
        problems = list(_class_pairs(tree, place, meshes_of(folder), "posed", {}))
        found.problems += problems
        if problems:
            yield place


def _class_pairs(
    tree: Tree,
    base: str,
    shapes: Mapping[str, FileSource | None],
    layout: str,
    vts: Mapping[str, FileSource],
) -> Iterator[Problem]:
    classes: dict[str, list[tuple[int, str]]] = defaultdict(list)
    for stem in shapes:
        match = _POSED.fullmatch(stem)
        if match:
            classes[match["class_name"] or tree.name_of(base)].append((int(match["number"]), stem))
    for class_name, members in sorted(classes.items()):
        (_, first), *others = sorted(members)
        for number, stem in others:
            yield Problem(
                name=stem,
                split="full",
                class_name=class_name,
                number=number,
                archive=tree.name_of(base),
                layout=layout,
                part=shapes[stem],
                full=shapes[first],
                truth=vts.get(stem),
                numbering="common" if layout == "vts" else "same",
                other=vts.get(first),
            )


def _is_null(place: str) -> bool:
    return place.rpartition("/")[2] == "null" or place.endswith("null/off")


def _base(place: str) -> str:
    """Return the folder that holds `null`."""
    return _parent(_parent(place) if place.endswith("/off") else place)


def _parent(place: str) -> str:
    return place.rpartition("/")[0]


def _natural(stem: str) -> list[tuple[int, int, str]]:
    return [(1, int(word), "") if word.isdigit() else (0, 0, word) for word in re.split(r"(\d+)", stem) if word]
