"""Look at a report in a headless Chromium: python tests/browser/check.py DIR [PICTURES].

DIR holds the results of `nonrigid bench`, reported. The browser is `$NONRIGID_BROWSER`, or a Chromium under one of its
usual names; without one the check fails and says so. PICTURES is a folder for screenshots.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

from chromium import Page, chromium, find

OVERVIEW_SECONDS = 2.0
CHECKS: list[Callable[[Page, Path, Path | None], str]] = []


def check(function: Callable[[Page, Path, Path | None], str]) -> Callable[[Page, Path, Path | None], str]:
    CHECKS.append(function)
    return function


@check
def the_overview_opens(page: Page, report: Path, pictures: Path | None) -> str:
    page.size(1400, 1900)
    page.dark(False)
    blank = report / "assets" / "style.css"
    idle, seconds = (min(page.open(path) for _ in range(5)) for path in (blank, report / "index.html"))
    spent = f"{seconds:.2f} s; a style sheet alone {idle:.2f} s"
    assert seconds < OVERVIEW_SECONDS, f"more than {OVERVIEW_SECONDS} s: {spent}"
    broken = page.run("""Promise.all([...document.images].map(image => {
        image.loading = 'eager';
        return image.decode().then(() => null, () => image.src);
    })).then(found => found.filter(Boolean))""")
    assert not broken, f"pictures are missing: {broken}"
    snap(page, pictures, "report-overview")
    return f"{spent}; {page.run('NONRIGID.grid.rows.length')} runs"


@check
def the_overview_sorts(page: Page, report: Path, pictures: Path | None) -> str:
    column = page.run("NONRIGID.tables.runs.columns.findIndex(column => column.heading === 'mean error x100')")
    button = f"NONRIGID.grid.heads[{column}].querySelector('button')"
    # With the keyboard, as a reader without a mouse does.
    page.run(f"{button}.focus()")
    for direction, sign in (("ascending", 1), ("descending", -1)):
        page.press("Enter")
        assert page.run(f"NONRIGID.grid.heads[{column}].getAttribute('aria-sort')") == direction
        shown = page.run(f"NONRIGID.grid.found.map(row => row.values[{column}])")
        known = [value for value in shown if value is not None]
        assert known == sorted(known, key=lambda value: sign * value), f"{direction} is out of order"
        assert shown[: len(known)] == known, "missing values are not last"
        first = page.run(f"NONRIGID.grid.table.tBodies[0].rows[0].cells[{column}].textContent")
        assert abs(float(first) - known[0]) <= 1e-3 * abs(known[0]) + 1e-9
    static = page.run("""(() => {
        const table = document.querySelector('table[data-sortable]');
        table.querySelector('th button').click();
        const names = [...table.tBodies[0].rows].map(row => row.cells[0].textContent);
        return [names, table.querySelector('th').getAttribute('aria-sort')];
    })()""")
    assert static[0] == sorted(static[0], key=str.lower), static
    return f"{len(shown)} runs both ways by keyboard, {len(static[0])} rows of the first table"


@check
def the_overview_filters(page: Page, report: Path, pictures: Path | None) -> str:
    total = page.run("NONRIGID.grid.rows.length")
    choice = page.run("""(() => {
        const select = [...document.querySelectorAll('[data-filters] select')].pop();
        select.value = select.options[1].value;
        select.dispatchEvent(new Event('change'));
        return [select.value, select.parentNode.textContent.split(' ')[0]];
    })()""")
    kept = page.run("NONRIGID.grid.found.length")
    assert 0 < kept < total, f"{choice} keeps {kept} of {total}"
    pair = page.run("NONRIGID.grid.found[0].values[0]")
    page.run("document.querySelector('input[type=search]').focus()")
    for letter in pair:
        page.press(letter)
    found = page.run("NONRIGID.grid.found.map(row => row.values[0])")
    assert found, "nothing is found"
    assert all(pair in name for name in found), found
    assert page.run("document.querySelector('[data-count]').textContent").endswith(f"of {total}")
    return f"{kept} of {total} with {choice[1]} {choice[0]}, {len(found)} of them with {pair!r}"


@check
def a_pair_shows_both_surfaces(page: Page, report: Path, pictures: Path | None) -> str:
    page.size(1400, 1750)
    seconds = page.open(best_pair(page, report))
    page.wait("!!(window.NONRIGID && NONRIGID.page && NONRIGID.page.pair)")
    settle(page)
    shown = [inked(page, name) for name in ("part", "full")]
    assert min(shown) > 0.02, f"of the canvases {shown} is drawn on"
    return f"{seconds:.2f} s; {shown[0]:.0%} and {shown[1]:.0%} of the canvases drawn on"


@check
def the_surfaces_turn_together(page: Page, report: Path, pictures: Path | None) -> str:
    x, y, _, _ = place(page, "part")
    before = picture(page, "full")
    page.drag((x, y), (x + 90, y + 30))
    settle(page)
    first, second = page.run("NONRIGID.page.pair.cameras.map(camera => camera.turn)")
    assert first == second, "the cameras differ"
    assert picture(page, "full") != before, "the other surface did not move"
    page.run("document.getElementById('full').focus()")
    page.press("ArrowLeft")
    turned = page.run("NONRIGID.page.pair.cameras.map(camera => camera.turn)")
    assert turned[0] == turned[1] != first, "the arrow keys do not turn both"
    page.run("document.getElementById('link').click()")
    page.drag((x, y), (x - 60, y))
    first, second = page.run("NONRIGID.page.pair.cameras.map(camera => camera.turn)")
    assert first != second, "they turn together although they should not"
    page.run("document.getElementById('link').click(); document.getElementById('reset').click()")
    return "by mouse and keys; apart when unlinked"


@check
def a_picked_point_is_shown_with_match_truth_and_error(page: Page, report: Path, pictures: Path | None) -> str:
    settle(page)
    x, y = page.run("""(() => {
        const view = NONRIGID.page.pair.views[0], box = view.canvas.getBoundingClientRect();
        for (const [u, v] of [[.5, .5], [.45, .4], [.55, .6], [.4, .6], [.6, .4], [.5, .3], [.5, .7], [.35, .35]])
            if (view.pick(u * box.width, v * box.height) >= 0)
                return [box.left + u * box.width, box.top + v * box.height];
        return null;
    })()""")
    page.click(x, y)
    settle(page)
    answer = page.run("NONRIGID.page.pair.answer")
    assert answer, "a click picks nothing"
    assert answer["matched"], "it has no match"
    assert answer["marks"] >= 2, "match or truth has no mark"
    told = page.run("document.getElementById('readout').textContent")
    assert "geodesic error" in told, told
    apart = page.run("""(() => {
        const pair = NONRIGID.page.pair, {vertex} = pair.answer, {points, truth} = pair;
        const a = pair.position(points, points.of[vertex]), b = pair.position(truth, truth.of[vertex]);
        return Math.hypot(...a.map((value, k) => value - b[k]));
    })()""")
    page.run("document.getElementById('after').click()")
    assert page.run("NONRIGID.page.pair.answer.vertex") > answer["vertex"], "the next match is not next"
    snap(page, pictures, "report-pair")
    return f"{told} (straight distance {apart:.3g} in the file's unit)"


@check
def colours_follow_the_choice(page: Page, report: Path, pictures: Path | None) -> str:
    seen = [picture(page, "part")]
    for mode in ("truth", "error"):
        page.run(f"document.querySelector('input[value={mode}]').click()")
        settle(page)
        seen.append(picture(page, "part"))
    assert len(set(seen)) == 3, "match, truth and error look alike"
    page.dark(True)
    settle(page)
    snap(page, pictures, "report-pair-dark")
    page.dark(False)
    return "match, truth and error differ"


@check
def every_run_has_route_status_words_and_trace(page: Page, report: Path, pictures: Path | None) -> str:
    page.wait("!!window.Plotly && !!document.querySelector('#trace .main-svg')")
    runs = page.run("NONRIGID.pair.runs.map(run => [run.id, run.status, run.stages.length])")
    for run, status, stages in runs:
        page.run(f"document.querySelector('tr[data-run=\"{run}\"] input').click()")
        text = page.run("document.getElementById('details').textContent")
        assert status in text, run
        assert page.run("document.querySelectorAll('#details tbody tr').length") == stages
    lines = page.run("document.querySelectorAll('#trace .scatterlayer .trace').length")
    assert lines > 0, "no trace is drawn"
    return f"{len(runs)} runs, {lines} traces of the first problem"


@check
def nothing_complains_and_nobody_is_asked(page: Page, report: Path, pictures: Path | None) -> str:
    assert not page.complaints, page.complaints
    asked = [url for url in page.requests if not url.startswith(("file:", "data:", "blob:"))]
    assert not asked, asked
    return f"{len(page.requests)} files read from disk, no other request, no message on the console"


def best_pair(page: Page, report: Path) -> Path:
    """Return the page of the pair whose run has the most matches."""
    page.open(report / "index.html")
    link = page.run("""(() => {
        const {columns, rows, pages} = NONRIGID.tables.runs;
        const k = columns.findIndex(column => column.heading === 'matches');
        return pages[rows.reduce((best, row) => ((row[k] ?? -1) > (best[k] ?? -1) ? row : best))[0]];
    })()""")
    return report / link


def settle(page: Page) -> None:
    page.run(
        "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done))))"
    )


def place(page: Page, name: str) -> list[float]:
    return list(
        page.run(f"""(() => {{ const b = document.getElementById('{name}').getBoundingClientRect();
        return [b.left + b.width / 2, b.top + b.height / 2, b.width, b.height]; }})()""")
    )


def picture(page: Page, name: str) -> str:
    return str(page.run(f"document.getElementById('{name}').toDataURL()"))


def inked(page: Page, name: str) -> float:
    """Return the share of a canvas that is drawn on."""
    return float(
        page.run(f"""(() => {{
        const gl = NONRIGID.page.pair.views[{["part", "full"].index(name)}].gl;
        const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight], data = new Uint8Array(4 * w * h);
        gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, data);
        let count = 0;
        for (let i = 3; i < data.length; i += 4) count += data[i] > 0;
        return count / (w * h);
    }})()""")
    )


def snap(page: Page, pictures: Path | None, name: str) -> None:
    if pictures is not None:
        time.sleep(0.3)
        page.screenshot(pictures / f"{name}.png")


def main(words: list[str]) -> int:
    program = find()
    if program is None:
        sys.stderr.write("there is no Chromium: install one, or name it in $NONRIGID_BROWSER\n")
        return 2
    report = Path(words[0]) / "report"
    pictures = Path(words[1]) if len(words) > 1 else None
    failed = 0
    with chromium(program) as page:
        for function in CHECKS:
            name = function.__name__.replace("_", " ")
            try:
                sys.stdout.write(f"ok    {name}: {function(page, report, pictures)}\n")
            except (AssertionError, RuntimeError, TimeoutError) as failure:
                failed += 1
                sys.stdout.write(f"WRONG {name}: {failure}\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
