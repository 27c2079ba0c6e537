"""Movies: pictures of the written steps of a run, one after the other."""
import shutil
import subprocess
import tempfile
from pathlib import Path

import matplotlib.animation
import matplotlib.pyplot as plt
from packing_picture import draw_packing, shared_frame
from picture_style import PictureError
from whole_file import MOVIES, PICTURES, claim, give_names, save_figure, written


def draw_movie(run, options):
    """A movie (.gif, .mp4) or, for any other path, a directory of frames, which get their names when all of them are there."""
    out = options.out or run.directory / "movie.gif"
    if out.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise PictureError(f"{out}: no program ffmpeg; expected a movie .gif, or a directory for frames")
    if out.suffix in (".avi", ".mkv", ".mov", ".webm"):
        raise PictureError(f"{out}: expected a movie .gif or .mp4, or a directory for frames")
    movie = out.suffix in MOVIES
    if movie:
        claim(out, MOVIES)
    steps = [step for step in run.steps if len(run.bodies(step)) > 0][::options.every]
    names = [f"frame_{k:05d}.png" for k in range(len(steps))]
    if not movie:
        check_frames(out, names)
    frame = shared_frame(run, steps, options)
    try:
        (out.parent if movie else out).mkdir(parents=True, exist_ok=True)
        scratch = tempfile.TemporaryDirectory(prefix=".frames-", dir=None if movie else out)
    except OSError as reason:
        raise PictureError(f"{out}: {reason.strerror}; expected a place for files") from None
    with scratch as folder:
        paths = [Path(folder) / name for name in names]
        for path, step in zip(paths, steps):
            figure = draw_packing(run, step, options, frame)
            # frames of one size
            save_figure(figure, path, dpi=100, metadata={"Software": None})
            plt.close(figure)
        if movie:
            join_frames(paths, out, options.fps)
        else:
            give_names({out / path.name: path for path in paths})
    print(out)


def check_frames(folder, names):
    """Refuse a directory in which a frame would replace a file that is no picture, or in which frames of a longer movie would stay."""
    for name in names:
        claim(folder / name, PICTURES)
    others = sorted(path.name for path in folder.glob("frame_[0-9]*.png") if path.name not in names)
    if others:
        raise PictureError(f"{folder}: {others[0]}{f' to {others[-1]}' if len(others) > 1 else ''} of another movie, which this one of {len(names)} frames "
                           "would leave there; expected a directory without them")


def join_frames(paths, out, fps):
    """A movie of pictures of one size, which are read one after the other: all of a long run would not fit into memory."""
    first = plt.imread(paths[0])
    height, width = first.shape[:2]
    figure = plt.figure(figsize=(width / 100, height / 100), dpi=100)
    image = figure.figimage(first)
    play = matplotlib.animation.FuncAnimation(figure, lambda k: [image.set_data(plt.imread(paths[k]))], frames=len(paths))
    try:
        with written(out, MOVIES) as part:
            play.save(part, writer="ffmpeg" if out.suffix == ".mp4" else "pillow", fps=fps)
    except subprocess.CalledProcessError as reason:
        raise PictureError(f"{out}: ffmpeg ended with status {reason.returncode}; expected a movie .gif, or a directory for frames") from None
    plt.close(figure)
