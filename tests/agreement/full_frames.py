#!/usr/bin/env python3
"""Whole frames at default accuracy against path tracing of everything: what the tests check in small.

    full_frames.py BRUME SHARED WORKDIR [NAME ...]              compares, prints a line a scene
    full_frames.py BRUME SHARED WORKDIR --references [NAME ...] makes the references anew

References are 8x8 means of luminance and transmittance in references/NAME.json, with the command that
made them. SHARED is the folder with data/ and tools/. Needs python3-openimageio and python3-numpy;
about half an hour of CPU for all scenes, three times that for references.
"""
import json
import os
import resource
import subprocess
import sys

import numpy as np
import OpenImageIO as oiio

HERE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "references")
BLOCK = 8
EVERYTHING = ["-D", '/render/volume_bounces="auto"', "-D", "/render/bounces=64"]
# Scene, options of both integrators, samples of the reference, and whether only smoke counts: blocks
# that pass less than 0.3 of the light behind them.
SCENES = {
    "cornell_smoke1": ("scenes/cornell_smoke1.json", EVERYTHING + ["--res", "128x128"], 1024, False),
    "cornell_wdas_cloud": ("scenes/cornell_wdas_cloud.json", EVERYTHING + ["--res", "128x128"], 1024, False),
    "cornell_teapot_cloud": ("scenes/cornell_teapot_cloud.json", EVERYTHING + ["--res", "128x128"], 1024, False),
    "smoke1": ("vdb/smoke1.vdb", ["--res", "128x96"], 512, True),
    "wdas_cloud_sixteenth": ("vdb/wdas_cloud_sixteenth.vdb", ["--res", "128x96"], 512, True),
    "teapot_cloud": ("vdb/teapot_cloud.vdb", ["--res", "128x96"], 512, True),
}


def blocks(pixels):
    h, w = (n // BLOCK * BLOCK for n in pixels.shape)
    return pixels[:h, :w].reshape(h // BLOCK, BLOCK, w // BLOCK, BLOCK).mean((1, 3))


def load(path):
    """8x8 means of luminance by layer, and of transmittance."""
    image = oiio.ImageBuf(path)
    spec = image.spec()
    pixels = image.get_pixels(oiio.FLOAT).reshape(spec.height, spec.width, -1).astype(float)
    names = list(spec.channelnames)
    layers = {}
    for name in names:
        layer, _, channel = name.rpartition(".")
        if channel != "R":
            continue
        rgb = [names.index((layer + "." if layer else "") + c) for c in "RGB"]
        layers[layer or "beauty"] = blocks(pixels[..., rgb] @ [0.2126, 0.7152, 0.0722])
    return layers


def run(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)}: exit {done.returncode}: {done.stderr[-500:]}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    arguments = sys.argv[1:]
    makes_references = "--references" in arguments
    brume, shared, folder, *chosen = (a for a in arguments if a != "--references")
    os.makedirs(folder, exist_ok=True)
    os.makedirs(HERE, exist_ok=True)
    unknown = [name for name in chosen if name not in SCENES]
    if unknown:
        sys.exit(f"no scene {unknown[0]}: {', '.join(SCENES)}")
    for name in chosen or SCENES:
        scene, options, samples, only_smoke = SCENES[name]
        image, stored = os.path.join(folder, name + ".exr"), os.path.join(HERE, name + ".json")
        base = ["render", scene, *options, "--depth", "float", "--progress", "none"]
        if not makes_references and not os.path.exists(stored):
            print(f"{name}: no reference; make it with --references {name}", flush=True)
            continue
        if makes_references:
            base += ["--integrator", "path", "--transport", "full", "--spp", str(samples)]
        command = [brume, *base, "-o", image]
        command[2] = os.path.join(shared, "data", scene)
        seconds = run(command)
        layers = load(image)
        if makes_references:
            kept = {"command": "brume " + " ".join(base), "cpu_seconds": round(seconds, 1)}
            for layer in ("beauty", "transmittance"):
                kept[layer] = [[float(f"{v:.5g}") for v in row] for row in layers[layer]]
            with open(stored, "w") as file:
                json.dump(kept, file)
            print(f"{name}: reference made in {seconds:.0f} CPU s", flush=True)
            continue
        with open(stored) as file:
            reference = json.load(file)
        truth = np.array(reference["beauty"])
        counts = np.array(reference["transmittance"]) < 0.3 if only_smoke else np.ones(truth.shape, bool)
        error = (layers["beauty"] - truth)[counts]
        mean = truth[counts].mean()
        print(f"{name}: mean {100 * error.mean() / mean:+.2f} %, blocks "
              f"{100 * np.sqrt((error ** 2).mean()) / mean:.2f} % of {counts.sum()} blocks, "
              f"{seconds:.0f} CPU s", flush=True)


if __name__ == "__main__":
    main()
