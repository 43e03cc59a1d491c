"""An animation of a run as GIF or MP4: the robot in the middle, the cars in the colours of their values.

The frames are drawn with Pillow directly: a figure library needs a second for what here takes milliseconds.
"""

import shutil
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image, ImageColor, ImageDraw, ImageFont

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.road_view import body_corners
from hj_cosim.analysis.figures.value_plot import value_colours
from hj_cosim.analysis.plan_path import plan_path, tracking_of
from hj_cosim.analysis.values import car_values
from hj_cosim.analysis.view import View, height_of, stretches
from hj_cosim.errors import OutputError
from hj_cosim.files import whole_file
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import Run

FRAME_TIME = {".gif": 0.08, ".mp4": 0.04}  # s; a GIF counts in hundredths
BEHIND, AHEAD = 50.0, 100.0  # m in view
WIDTH = 900  # pixels
HEADER, STRIP, MARGIN = 24, 64, 10  # pixels
OVERSAMPLING = 2  # drawn this much larger, then averaged, for smooth edges
LOOKED_AT_EVERY = 50  # samples
FLASH = 10  # samples around an intervention that are marked
PALE_INTERVENTION = "#F8F3B8"
VALUE_RANGE = (-10.0, 30.0)  # m, of the value's strip

Progress = Callable[[int, int], None]


def write_replay(run: Run, table: ValueTable, out: Path | None = None, progress: Progress | None = None) -> Path:
    """Write an animation of a run at the speed at which it was driven.

    Args:
        run: the run.
        table: V, for the colours of the cars.
        out: a .gif, or an .mp4 where ffmpeg is installed; `replay.gif` in the run's folder unless given.
        progress: called with the frames drawn and the frames in all.

    Returns:
        The file.

    Raises:
        OutputError: if the ending is another, or ffmpeg is needed and missing or fails.
        HjCosimError: if the file cannot be written.
    """
    target = out or run.folder / "replay.gif"
    if target.suffix not in FRAME_TIME:
        raise OutputError(f"cannot write {target}: a replay ends in .gif or .mp4")
    if target.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise OutputError(f"cannot write {target}: ffmpeg is not installed; install it, or write a .gif")
    frame_time = FRAME_TIME[target.suffix]
    artist = FrameArtist(run, table)
    samples = frame_samples(run.record.time, frame_time)
    report = progress or (lambda done, total: None)
    with whole_file(target) as temporary:
        if target.suffix == ".gif":
            _write_gif(artist, samples, frame_time, temporary, report)
        else:
            _write_mp4(artist, samples, frame_time, temporary, report)
    return target


def frame_samples(time: np.ndarray, frame_time: float) -> np.ndarray:
    """Return the samples to draw, evenly spaced in time (T,) by `frame_time` (s), the last sample at the end."""
    wanted = np.arange(time[0], time[-1], frame_time)
    return np.unique(np.append(np.searchsorted(time, wanted - 1e-9), len(time) - 1))


class FrameArtist:
    """Draws the frames of one run."""

    def __init__(self, run: Run, table: ValueTable) -> None:
        self._run = run
        self._tracking = tracking_of(run)
        record = run.record
        self._values = car_values(record, table)
        self._pixels_per_metre = WIDTH * OVERSAMPLING / (BEHIND + AHEAD)
        # A bend is looked at now and then, often enough to hold it all: it does not change much within a second.
        self._height = height_of(record.road, record.robot.x[::LOOKED_AT_EVERY], BEHIND, AHEAD)
        self._road_height = round((self._height[1] - self._height[0] + 2.0) * self._pixels_per_metre)
        self._strip_top = HEADER * OVERSAMPLING + self._road_height + MARGIN * OVERSAMPLING
        height = self._strip_top + 2 * (STRIP + MARGIN) * OVERSAMPLING + 14 * OVERSAMPLING
        self._size = (WIDTH * OVERSAMPLING, 2 * (height // 2) + height % 2)
        self._font = ImageFont.load_default(size=12 * OVERSAMPLING)
        self._small = ImageFont.load_default(size=10 * OVERSAMPLING)
        self._background = self._draw_background()

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a frame in pixels; both even, as video coders want them."""
        return WIDTH, (self._size[1] // OVERSAMPLING) // 2 * 2

    def frame(self, sample: int) -> Image.Image:
        """Return the frame of a sample."""
        image = self._background.copy()
        draw = ImageDraw.Draw(image)
        self._draw_header(draw, sample)
        self._draw_lanes(draw, sample)
        self._draw_plan(draw, sample)
        self._draw_cars(draw, sample)
        self._draw_cursor(draw, sample)
        return image.reduce(OVERSAMPLING).crop((0, 0, *self.size))

    def _flashes(self, sample: int) -> bool:
        """Return whether the filter intervenes about now: what goes on and off from step to step must not flicker."""
        return bool(self._run.record.robot.intervening[max(sample - FLASH, 0) : sample + FLASH + 1].any())

    def _to_pixels(self, points: np.ndarray, sample: int) -> np.ndarray:
        """Return pixels (..., 2) of road coordinates (..., 2), the robot at its fixed place."""
        robot, road = self._run.record.robot, self._run.record.road
        top = self._height[1] + 1.0
        shown = View(road, float(robot.x[sample])).points(points)
        x = (shown[..., 0] - robot.x[sample] + BEHIND) * self._pixels_per_metre
        y = (top - shown[..., 1]) * self._pixels_per_metre + HEADER * OVERSAMPLING
        return np.stack([x, y], axis=-1)

    def _draw_header(self, draw: ImageDraw.ImageDraw, sample: int) -> None:
        record = self._run.record
        value = record.robot.value[sample]
        shown = f"{value:6.1f} m" if np.isfinite(value) else "nobody near"
        text = f"t = {record.time[sample]:5.2f} s    v = {record.robot.speed[sample]:5.2f} m/s    V = {shown}"
        if self._flashes(sample):
            draw.rectangle((0, 0, self._size[0], HEADER * OVERSAMPLING), fill=style.INTERVENTION)
            text += "    the filter intervenes"
        if record.threats.collision[sample]:
            draw.rectangle((0, 0, self._size[0], HEADER * OVERSAMPLING), fill=style.VERMILION)
            text += "    COLLISION"
        draw.text((8 * OVERSAMPLING, 4 * OVERSAMPLING), text, fill="black", font=self._font)

    def _draw_lanes(self, draw: ImageDraw.ImageDraw, sample: int) -> None:
        record = self._run.record
        start = record.robot.x[sample] - BEHIND
        for along, lines in stretches(record.road, start - 5.0, start + BEHIND + AHEAD + 5.0):
            if not record.road.is_straight:  # else it is in the background
                sides = [
                    self._to_pixels(np.column_stack([along, np.full(len(along), y)]), sample) for y in lines[[0, -1]]
                ]
                corners = [tuple(corner) for corner in np.vstack([sides[0], sides[1][::-1]])]
                draw.polygon(corners, style.ASPHALT, style.GREY, OVERSAMPLING)
            dashes = np.arange(np.floor(along[0] / 12.0) * 12.0, along[-1] + 12.0, 12.0)  # move with the road
            for y in lines[1:-1]:
                ends = np.stack([np.column_stack([dashes, np.full_like(dashes, y)])] * 2, axis=1)
                ends[:, 1, 0] += 4.0
                for dash in self._to_pixels(ends, sample):
                    draw.line([tuple(dash[0]), tuple(dash[1])], fill=style.LANE_LINE, width=OVERSAMPLING)

    def _draw_plan(self, draw: ImageDraw.ImageDraw, sample: int) -> None:
        points = self._to_pixels(plan_path(self._run.record, sample, self._tracking), sample)
        for first, second in zip(points[::2], points[1::2], strict=False):
            draw.line([tuple(first), tuple(second)], fill=style.ROBOT, width=2 * OVERSAMPLING)

    def _draw_cars(self, draw: ImageDraw.ImageDraw, sample: int) -> None:
        record, traffic = self._run.record, self._run.record.traffic
        ahead = traffic.x[sample] - record.robot.x[sample]
        seen = np.flatnonzero(traffic.present[sample] & (ahead > -BEHIND - 5.0) & (ahead < AHEAD + 5.0))
        bodies = body_corners(
            traffic.x[sample, seen],
            traffic.y[sample, seen],
            traffic.heading[sample, seen],
            traffic.length[seen],
            traffic.width[seen],
        )
        colours = np.round(255 * value_colours(self._values[sample, seen])).astype(int)
        rogues = record.is_rogue[seen]
        for corners, colour, rogue in zip(self._to_pixels(bodies, sample), colours, rogues, strict=True):
            edge, width = (style.ROGUE, 3 * OVERSAMPLING) if rogue else (style.CAR_EDGE, OVERSAMPLING)
            draw.polygon([tuple(corner) for corner in corners], tuple(colour[:3]), edge, width)
        self._draw_rings(draw, sample, seen)
        x, y, heading = (
            column[sample : sample + 1] for column in (record.robot.x, record.robot.y, record.robot.heading)
        )
        body = body_corners(x, y, heading, np.array([record.robot_length]), np.array([record.robot_width]))[0]
        outline = style.INTERVENTION if self._flashes(sample) else style.BLACK
        corners = [tuple(corner) for corner in self._to_pixels(body, sample)]
        draw.polygon(corners, style.ROBOT, outline, 2 * OVERSAMPLING)

    def _draw_rings(self, draw: ImageDraw.ImageDraw, sample: int, seen: np.ndarray) -> None:
        """Draw a ring around each car that the filter suspects, the darker the likelier it is that it means harm."""
        record, traffic = self._run.record, self._run.record.traffic
        if record.belief is None:
            return
        rings = body_corners(
            traffic.x[sample, seen],
            traffic.y[sample, seen],
            traffic.heading[sample, seen],
            traffic.length[seen] + style.RING[0],
            traffic.width[seen] + style.RING[1],
        )
        road, ring = (np.array(ImageColor.getrgb(colour)) for colour in (style.ASPHALT, style.SUSPECT))
        for corners, likely in zip(self._to_pixels(rings, sample), record.belief[sample, seen], strict=True):
            if likely > 0.0:  # not where nobody judged
                colour = tuple(np.round(road + likely * (ring - road)).astype(int).tolist())
                draw.polygon([tuple(corner) for corner in corners], None, colour, 2 * OVERSAMPLING)

    def _draw_background(self) -> Image.Image:
        """Return what is the same in every frame: the asphalt and the strips' curves."""
        image = Image.new("RGB", self._size, "white")
        draw = ImageDraw.Draw(image)
        road_top = HEADER * OVERSAMPLING + round(self._pixels_per_metre)
        road_bottom = HEADER * OVERSAMPLING + self._road_height - round(self._pixels_per_metre)
        record = self._run.record
        if record.road.is_straight:
            draw.rectangle((0, road_top, self._size[0], road_bottom), style.ASPHALT, style.GREY, OVERSAMPLING)
        speeds = np.concatenate([record.robot.speed, record.robot.plan_speed])
        speed_range = (float(speeds.min()) - 1.0, float(speeds.max()) + 1.0)
        self._draw_strip(draw, 0, "speed (m/s), planned: grey", speed_range)
        self._draw_curve(draw, 0, record.robot.plan_speed, speed_range, style.GREY)
        self._draw_curve(draw, 0, record.robot.speed, speed_range, style.BLUE)
        self._draw_strip(draw, 1, "least value V (m), V = 0: grey", VALUE_RANGE)
        self._draw_curve(draw, 1, np.zeros(len(record.time)), VALUE_RANGE, style.GREY)
        self._draw_curve(draw, 1, record.robot.value, VALUE_RANGE, style.VERMILION)
        return image

    def _strip_box(self, number: int) -> tuple[int, int]:
        top = self._strip_top + number * (STRIP + MARGIN) * OVERSAMPLING
        return top, top + STRIP * OVERSAMPLING

    def _across(self, samples: np.ndarray) -> np.ndarray:
        """Return the horizontal pixels of samples in the strips."""
        last = max(len(self._run.record.time) - 1, 1)
        return (MARGIN + (WIDTH - 2 * MARGIN) * samples / last) * OVERSAMPLING

    def _draw_strip(self, draw: ImageDraw.ImageDraw, number: int, label: str, limits: tuple[float, float]) -> None:
        top, bottom = self._strip_box(number)
        intervening = np.flatnonzero(self._run.record.robot.intervening)
        for x in self._across(intervening):
            draw.line((x, top, x, bottom), fill=PALE_INTERVENTION, width=OVERSAMPLING)
        left, right = MARGIN * OVERSAMPLING, (WIDTH - MARGIN) * OVERSAMPLING
        draw.rectangle((left, top, right, bottom), outline=style.LANE_LINE, width=1)
        text = f"{label}, {limits[0]:.0f} to {limits[1]:.0f}"
        draw.text((left + 6, top + 2), text, fill=style.GREY, font=self._small)

    def _draw_curve(
        self, draw: ImageDraw.ImageDraw, number: int, values: np.ndarray, limits: tuple[float, float], colour: str
    ) -> None:
        top, bottom = self._strip_box(number)
        share = (np.clip(values, *limits) - limits[0]) / (limits[1] - limits[0])
        points = np.column_stack([self._across(np.arange(len(values))), bottom - share * (bottom - top)])
        draw.line([tuple(point) for point in points], fill=colour, width=OVERSAMPLING)

    def _draw_cursor(self, draw: ImageDraw.ImageDraw, sample: int) -> None:
        x = float(self._across(np.array([sample]))[0])
        draw.line((x, self._strip_top, x, self._strip_box(1)[1]), fill=style.BLACK, width=OVERSAMPLING)


def _write_gif(artist: FrameArtist, samples: np.ndarray, frame_time: float, path: Path, progress: Progress) -> None:
    palette = _shared_palette(artist, samples)
    flat = partial(Image.Image.quantize, palette=palette, dither=Image.Dither.NONE)
    frames = (flat(frame) for frame in _frames(artist, samples, progress))
    duration = round(1000 * frame_time)
    next(frames).save(path, "GIF", save_all=True, append_images=frames, duration=duration, loop=0, optimize=False)


def _shared_palette(artist: FrameArtist, samples: np.ndarray) -> Image.Image:
    """Return one palette for all frames, from a few of them: with palettes of their own they would flicker."""
    chosen = samples[np.linspace(0, len(samples) - 1, 8).round().astype(int)]
    width, height = artist.size
    together = Image.new("RGB", (width, height * len(chosen)))
    for number, sample in enumerate(chosen):
        together.paste(artist.frame(int(sample)), (0, number * height))
    return together.quantize(256)


def _frames(artist: FrameArtist, samples: np.ndarray, progress: Progress) -> Iterator[Image.Image]:
    for done, sample in enumerate(samples, start=1):
        yield artist.frame(int(sample))
        progress(done, len(samples))


def _write_mp4(artist: FrameArtist, samples: np.ndarray, frame_time: float, path: Path, progress: Progress) -> None:
    width, height = artist.size
    command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
    command += [
        "-r",
        f"{1.0 / frame_time:g}",
        "-i",
        "-",
        "-preset",
        "veryfast",
        "-pix_fmt",
        "yuv420p",
        "-movflags",
        "+faststart",
        str(path),
    ]
    coder = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    assert coder.stdin is not None
    assert coder.stderr is not None
    try:
        for frame in _frames(artist, samples, progress):
            coder.stdin.write(frame.tobytes())
    except BrokenPipeError:
        pass  # ffmpeg gave up; what it says comes below
    finally:
        coder.stdin.close()
    message = coder.stderr.read().decode(errors="replace").strip()
    if coder.wait() != 0:
        raise OutputError(f"ffmpeg could not write {path.name}: {message or 'no reason given'}; write a .gif instead")
