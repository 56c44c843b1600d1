"""Animations: of a search, in which the tree grows, the path becomes shorter and the lower bound rises; and of a drive.

>>> recording = Recording()
>>> result = plan(problem, settings, on_progress=recording, report_samples=50)
>>> recording.save("maze.gif", result)
>>> save_drive("drive.gif", result)
"""

import base64
import io
import json
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import accumulate
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from PIL import Image

from ..maps.model import Map
from . import ANIMATIONS, VIDEO, check_ffmpeg
from .drawing import (
    BOTTOM,
    LEFT,
    PATH,
    RIGHT,
    Drawing,
    draw_map,
    draw_path,
    draw_poses,
    draw_tree,
    draw_vehicle,
    frame,
    of_plan,
    view,
)

if TYPE_CHECKING:
    from ..result import Plan, Progress

#: Maximum number of frames; of more, some are left out evenly.
MOST_FRAMES = 90
#: Time that a frame is shown, and the last one [ms].
SHOWN, LAST_SHOWN = 90, 2500
#: Longer side of the map, height of the curves below it, and room for the title [inch].
MAP_SIDE, CURVES, TITLE = 5.0, 1.15, 0.5
#: Resolution [1/inch], and number of colours.
DPI, COLOURS = 100, 64
#: The colour of the lower bound.
BOUND = "#0072b2"


class Frame(NamedTuple):
    """The state of a search that one frame shows.

    Attributes:
        drawing: tree and path; its titles are not shown.
        samples: number of samples drawn so far.
        length: length of the path so far [m], or None.
        lower_bound: no path is shorter [m].
    """

    drawing: Drawing
    samples: int
    length: float | None
    lower_bound: float


class Recording:
    """A record of a search, made as the `on_progress` of plan()."""

    def __init__(self, samples: int = 0):
        """Keep a frame after so many samples at least, and one for each better path."""
        self._every = samples
        self._frames: list[Frame] = []

    @property
    def frames(self) -> int:
        """The number of frames of the animation."""
        return min(len(self._frames) + 1, MOST_FRAMES)

    def __call__(self, progress: "Progress") -> None:
        """Keep the state of a search."""
        last = self._frames[-1].samples if self._frames else -self._every
        if progress.improved or progress.samples >= last + max(1, self._every):
            self._add(replace(progress.snapshot(), tree=progress.tree(), samples=progress.samples))

    def _add(self, plan: "Plan") -> None:
        self._frames.append(Frame(of_plan(plan), plan.samples, plan.length, plan.lower_bound))

    def save(self, file: str, plan: "Plan", on_frame: Callable[[int], None] | None = None) -> None:
        """Write the animation, which ends with the plan; the ending of the file, .gif, .mp4 or .html, selects the format.

        Args:
            file: what to write.
            plan: the answer of the search that was recorded.
            on_frame: called after each frame with the number of those that are drawn, of `frames`.

        Raises:
            PictureError: the ending is .mp4, and ffmpeg is not installed.
        """
        chosen = np.unique(np.linspace(0, len(self._frames), self.frames).round().astype(int))
        self._add(plan)
        _save(file, _SearchScreen(self._frames), chosen.tolist(), on_frame)


def save_drive(file: str, plan: "Plan", on_frame: Callable[[int], None] | None = None) -> None:
    """Write an animation of the vehicle that drives along the path of a plan, with its clearance below the map.

    Args:
        file, on_frame: as for `Recording.save`.
        plan: an answer with a path.

    Raises:
        PictureError: the ending is .mp4, and ffmpeg is not installed.
    """
    screen = _DriveScreen(plan)
    ends = np.linspace(0, screen.driven[-1], MOST_FRAMES)
    _save(file, screen, np.unique(np.searchsorted(screen.driven, ends, "right") - 1).tolist(), on_frame)


def _save(file: str, screen: "_Screen", frames: Sequence[int], on_frame: Callable[[int], None] | None) -> None:
    ending = Path(file).suffix.lower()
    if ending == VIDEO:
        check_ffmpeg()
    pictures = []
    for picture in screen.pictures(frames):
        pictures.append(picture)
        if on_frame:
            on_frame(len(pictures))
    WRITERS[ending](file, pictures)


class _Screen:
    """A base of figures that show frame after frame: the map, and below it curves, over which the frames have their numbers."""

    def __init__(self, world_map: Map):
        low, high = view(world_map)
        width, height = MAP_SIDE * (high - low) / (high - low).max()
        below = BOTTOM + CURVES + BOTTOM
        across, up = width + LEFT + RIGHT, below + height + TITLE
        self._figure = Figure(figsize=(across, up), dpi=DPI)
        self._map = self._figure.add_axes((LEFT / across, below / up, width / across, height / up))
        frame(self._map, world_map)
        draw_map(self._map, world_map)
        self._curves = self._figure.add_axes((LEFT / across, BOTTOM / up, width / across, CURVES / up))
        self._curves.spines[["top", "right"]].set_visible(False)
        self._curves.yaxis.set_major_locator(MaxNLocator(4))
        for one in (self._map, self._curves):
            one.tick_params(labelsize=8)
            one.yaxis.label.set_fontsize(9)
            one.xaxis.label.set_fontsize(9)
        self._lines: list[Line2D] = []
        self._title = self._figure.text(LEFT / across, 1 - 0.13 / up, "", fontsize=11, weight="bold", va="top")

    def pictures(self, frames: Sequence[int]) -> Iterator[Image.Image]:
        """Yield the pictures of the frames of these numbers, in order."""
        # What all frames share is drawn once: map, axes and labels take most of the time.
        canvas = FigureCanvasAgg(self._figure)
        canvas.draw()
        shared, artists = canvas.copy_from_bbox(self._figure.bbox), set(self._map.get_children())
        for shown in frames:
            self._show(shown)
            canvas.restore_region(shared)
            changed = set(self._map.get_children()) - artists
            for artist in (*sorted(changed, key=Artist.get_zorder), *self._lines, self._title):
                artist.draw(canvas.get_renderer())
            yield Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
            for artist in changed:
                artist.remove()

    def _show(self, shown: int) -> None:
        """Draw what one frame shows on the map, and set the lines and the title."""
        raise NotImplementedError


class _SearchScreen(_Screen):
    """The tree and the path that a search has so far, and below them path and bound over the samples."""

    def __init__(self, frames: Sequence[Frame]):
        super().__init__(frames[-1].drawing.map)
        # A search that is recorded takes longer, and the proof beside it may get further than that of the answer, which is told.
        bounds = accumulate((min(one.lower_bound, frames[-1].lower_bound) for one in frames), max)
        self._frames = [one._replace(lower_bound=bound) for one, bound in zip(frames, bounds, strict=True)]
        values = (value for one in self._frames for value in (one.length, one.lower_bound))
        known = [value for value in values if value is not None and np.isfinite(value)]
        margin = 0.08 * (max(known) - min(known)) or 1.0
        self._curves.set(xlim=(0, max(1, frames[-1].samples)), ylim=(min(known) - margin, max(known) + margin), xlabel="samples",
                         ylabel="length [m]")
        self._lines = [self._curves.plot([], [], color=colour, linewidth=2, label=label, drawstyle="steps-post")[0]
                       for colour, label in ((PATH, "path"), (BOUND, "no path is shorter"))]
        self._curves.legend(loc="lower right", bbox_to_anchor=(1, 0.93), ncols=2, fontsize=8, frameon=False)

    def _show(self, shown: int) -> None:
        now = self._frames[shown]
        draw_tree(self._map, now.drawing.tree)
        draw_path(self._map, now.drawing.vehicle, now.drawing.path)
        draw_poses(self._map, self._frames[-1].drawing)  # whose path tells where their names stay
        past = [one for one in self._frames if one.samples <= now.samples]
        samples = [one.samples for one in past]
        self._lines[0].set_data(samples, [np.nan if one.length is None else one.length for one in past])
        self._lines[1].set_data(samples, [one.lower_bound for one in past])
        length = "no path yet" if now.length is None else f"path {now.length:.2f} m"
        self._title.set_text(f"{now.samples} samples, {length}\nno path is shorter than {now.lower_bound:.2f} m")


class _DriveScreen(_Screen):
    """The vehicle at each pose of a path, and below it the clearance over the distance driven.

    Attributes:
        driven: (n,) distance driven at each pose [m].
    """

    def __init__(self, plan: "Plan"):
        super().__init__(plan.problem.map)
        self._drawing, self._clearances, self._indices = of_plan(plan), plan.clearances(), plan.waypoint_indices
        chords = np.hypot(*np.diff(self._drawing.path[:, :2], axis=0).T)
        driven = np.append(0.0, np.cumsum(chords))
        self.driven = driven * ((plan.length or 0.0) / (driven[-1] or 1.0))  # of arcs, which are longer than their chords
        self._curves.set(xlim=(0, self.driven[-1] or 1.0), ylim=(0, 1.15 * self._clearances.max() or 1.0), xlabel="driven [m]",
                         ylabel="clearance [m]")
        self._lines = [self._curves.plot([], [], color=PATH, linewidth=2)[0]]

    def _show(self, shown: int) -> None:
        drawing, until = self._drawing, shown + 1
        draw_path(self._map, drawing.vehicle, drawing.path[:until])
        draw_poses(self._map, drawing)
        draw_vehicle(self._map, drawing.path[shown], PATH, drawing.vehicle)
        self._lines[0].set_data(self.driven[:until], self._clearances[:until])
        passed = sum(index <= shown for index in self._indices)
        waypoints = f", {passed} of {len(self._indices)} waypoints passed" if self._indices else ""
        self._title.set_text(f"{self.driven[shown]:.2f} m of {self.driven[-1]:.2f} m driven{waypoints}\n"
                             f"clearance {self._clearances[shown]:.2f} m")


def _write_gif(file: str, pictures: Sequence[Image.Image]) -> None:
    first, *others = _with_few_colours(pictures)
    first.save(file, save_all=True, append_images=others, duration=_durations(pictures), loop=0, optimize=True)


def _with_few_colours(pictures: Sequence[Image.Image]) -> list[Image.Image]:
    """Return the pictures in one palette, that of the last, in which everything is seen."""
    palette = pictures[-1].quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    return [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]


def _durations(pictures: Sequence[Image.Image]) -> list[int]:
    return [SHOWN] * (len(pictures) - 1) + [LAST_SHOWN]


def _write_mp4(file: str, pictures: Sequence[Image.Image]) -> None:
    width, height = pictures[0].size
    command = ["ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
               "-r", f"{1000 / SHOWN:.3f}", "-i", "-", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p",
               "-movflags", "+faststart", file]
    held = [pictures[-1]] * round(LAST_SHOWN / SHOWN)
    subprocess.run(command, input=b"".join(picture.tobytes() for picture in (*pictures, *held)), check=True)


_PAGE = Template("""<!DOCTYPE html>
<html lang="en"><meta charset="utf-8"><title>A search for a path</title>
<style>body { font: 16px sans-serif; max-width: $width; margin: 1em auto; } img { width: 100%; } input { width: 75%; }</style>
<img id="picture" alt="The map with the tree, the path, the start and the goal">
<p><button id="play">Pause</button> <input id="frame" type="range" min="0" value="0" aria-label="frame"></p>
<script>
const frames = $frames, picture = document.getElementById("picture");
const slider = document.getElementById("frame"), button = document.getElementById("play");
let timer = null;
function show(i) { slider.value = i; picture.src = "data:image/png;base64," + frames[i]; }
function step() {
  const next = (Number(slider.value) + 1) % frames.length;
  show(next);
  timer = setTimeout(step, next === frames.length - 1 ? $last : $shown);
}
function pause() { clearTimeout(timer); timer = null; button.textContent = "Play"; }
button.onclick = () => { if (timer) { pause(); } else { button.textContent = "Pause"; step(); } };
slider.max = frames.length - 1;
slider.oninput = () => { pause(); show(Number(slider.value)); };
show(0);
timer = setTimeout(step, $shown);
</script>
</html>
""")


def _write_html(file: str, pictures: Sequence[Image.Image]) -> None:
    """Write a page that holds all frames, and needs no network."""
    frames = []
    for picture in _with_few_colours(pictures):
        png = io.BytesIO()
        picture.save(png, "png", optimize=True)
        frames.append(base64.b64encode(png.getvalue()).decode())
    page = _PAGE.substitute(frames=json.dumps(frames), width=f"{pictures[0].width}px", shown=SHOWN, last=LAST_SHOWN)
    Path(file).write_text(page, encoding="utf-8")


#: What writes an animation, by the endings of files.
WRITERS: dict[str, Callable[[str, Sequence[Image.Image]], None]] = dict(
    zip(ANIMATIONS, (_write_gif, _write_mp4, _write_html), strict=True))
