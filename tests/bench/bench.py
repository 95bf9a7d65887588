#!/usr/bin/env python3
"""Every figure of cost that brume promises, in one table: tools/bench.sh builds what this needs and runs it.

usage: bench.py BUILD SHARED OUT [--only NAME,...]     or     bench.py BUILD SHARED OUT --make-references

Ratios are of CPU seconds in this very run, so that other work on the machine slows both sides. A race compares a
cached frame with path tracing of the same transport: the path tracer's cost is scaled by 1/N to the cached frame's
error of diffuse_indirect, by pixel and by 8x8 means (what an ideal denoiser would leave). References are stored
(references/*.exr: luminance, with the error that they have themselves, which is taken off).
"""
import argparse, json, os, resource, subprocess, sys, time
import numpy as np, OpenImageIO as oiio

RES, BLOCK = 256, 8
PATH = ["--integrator", "path", "--transport", "cached"]
LUMINANCE = [.2126, .7152, .0722]
HERE = os.path.dirname(os.path.abspath(__file__))
rows = []


def tell(name, value, bar=None, at_most=False, unit=""):
    if bar is None: verdict = ""
    elif (value <= bar) if at_most else (value >= bar): verdict = "pass"
    else: verdict = f"missed by {abs(value / bar - 1) * 100:.0f} %"
    rows.append({"name": name, "value": value, "bar": bar, "at_most": at_most, "unit": unit, "verdict": verdict})
    wanted = "" if bar is None else f"{'<=' if at_most else '>='} {bar:g}"
    print(f"{name:58} {value:10.4g} {unit:8} {wanted:9} {verdict}", flush=True)


def cpu(command):
    """CPU seconds of a command and all its children, and what it printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode: sys.exit(f"{' '.join(command)}: exit {done.returncode}: {done.stderr[-400:]}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def load(path, layer=None):
    image = oiio.ImageBuf(path); spec = image.spec(); names = list(spec.channelnames)
    pixels = image.get_pixels(oiio.FLOAT).reshape(spec.height, spec.width, -1).astype(float)
    if layer is None: return pixels[..., 0], spec
    return pixels[..., [names.index((layer + "." if layer != "beauty" else "") + c) for c in "RGB"]] @ LUMINANCE


def blocks(a):
    h, w = a.shape[0] // BLOCK, a.shape[1] // BLOCK
    return a[:h * BLOCK, :w * BLOCK].reshape(h, BLOCK, w, BLOCK).mean((1, 3))


class Bench:
    def __init__(self, build, shared, out):
        self.build, self.shared, self.out = build, shared, out
        self.brume = os.path.join(build, "bin/brume")
        os.makedirs(out, exist_ok=True)

    def scenes(self):
        demo = os.path.join(self.out, "demo")
        if not os.path.exists(demo + "/smoky_cornell.json"):
            cpu([os.path.join(self.build, "bin/data_gen"), "smoky-cornell", "--resolution", "128", "--size", "512", "-o", demo])
        scenes = {n: f"{self.shared}/data/scenes/{n}.json" for n in ("cornell_smoke1", "cornell_teapot_cloud")}
        scenes["demo"] = demo + "/smoky_cornell.json"
        return {n: s for n, s in scenes.items() if os.path.exists(s) or print(f"{s} is not there: {n} is left out")}

    def render(self, scene, name, *options, res=f"{RES}x{RES}"):
        image = os.path.join(self.out, name + ".exr")
        seconds, _ = cpu([self.brume, "render", scene, "-o", image, "--progress", "none", "--depth", "float",
                          *(["--res", res] if res else []), *options])
        return image, seconds

    def make_references(self):
        for name, scene in self.scenes().items():
            halves = [load(self.render(scene, f"{name}_{s}", *PATH, "--spp", "384", "--seed", str(s))[0], "diffuse_indirect")
                      for s in (101, 102)]
            mean = sum(halves) / 2
            own = [float(np.sqrt(((f(halves[0]) - f(halves[1]))**2).mean()) / 2 / mean.mean()) for f in (lambda a: a, blocks)]
            spec = oiio.ImageSpec(RES, RES, 1, oiio.HALF); spec.channelnames = ("Y",)
            spec.attribute("brume:own_errors", json.dumps(own)); spec.attribute("compression", "zip")
            spec.attribute("brume:made_by", f"render {name} --res {RES}x{RES} {' '.join(PATH)} --spp 384, seeds 101 and 102")
            image = oiio.ImageBuf(spec); image.set_pixels(oiio.ROI(), mean.astype(np.float32)[..., None].copy())
            image.write(f"{HERE}/references/{name}.exr")
            print(f"{name}: own errors {own}")

    def race(self, name, scene):
        reference, spec = load(f"{HERE}/references/{name}.exr")
        own = json.loads(spec.getattribute("brume:own_errors")); mean = reference.mean()

        def errors(path):
            a = load(path, "diffuse_indirect")
            return [float(np.sqrt(max(1e-12, ((f(a) - f(reference))**2).mean() / mean**2 - o * o)))
                    for f, o in zip((lambda a: a, blocks), own)], a.mean() / mean - 1
        path, path_cpu = self.render(scene, "path", *PATH, "--spp", "32", "--seed", "7")
        cache = os.path.join(self.out, "race.irc")
        if os.path.exists(cache): os.remove(cache)
        first, first_cpu = self.render(scene, "cached", "--cache", cache)
        _, second_cpu = self.render(scene, "again", "--cache", cache)
        (path_pixel, path_block), _ = errors(path); (pixel, block), bias = errors(first)
        tell(f"{name}: CPU seconds of a frame", first_cpu, unit="s")
        tell(f"{name}: CPU seconds of a second frame", second_cpu, unit="s")
        tell(f"{name}: mean", 100 * bias, unit="%")
        tell(f"{name}: pixel error", 100 * pixel, unit="%")
        tell(f"{name}: error of 8x8 means", 100 * block, 1.5, True, "%")
        by_pixel, by_block = path_cpu * (path_pixel / pixel)**2, path_cpu * (path_block / block)**2
        tell(f"{name}: path tracing to the same pixel error", by_pixel / first_cpu, 200, unit="times")
        tell(f"{name}: path tracing to the same error of 8x8 means", by_block / first_cpu, 6, unit="times")
        tell(f"{name}: the same of a second frame, by pixel", by_pixel / second_cpu, 1000, unit="times")
        tell(f"{name}: the same of a second frame, by 8x8 means", by_block / second_cpu, 30, unit="times")

    def races(self):
        for name, scene in self.scenes().items(): self.race(name, scene)

    def box(self):
        folder = f"{self.shared}/data/reference"
        if not os.path.exists(folder + "/smoky_box.json"): return print("The smoky box is not there: left out")
        a, b = (load(f"{folder}/smoky_box_{n}.exr", "beauty") for n in ("mitsuba_3072spp", "pbrt_384spp"))
        h, w = a.shape; y, x = np.mgrid[:h, :w]; x, y = (x + .5) / w, (y + .5) / h
        seen = ~((x > .41) & (x < .59) & (y > .085) & (y < .145)); mean = a[seen].mean()  # Without the lamp.
        # Neither reference's noise counts.
        error = lambda c: float(np.sqrt(max(1e-9, ((c - a) * (c - b))[seen].mean())) / mean)
        path, path_cpu = self.render(folder + "/smoky_box.json", "box_path", "--integrator", "path", "--transport", "full",
                                     "--spp", "32", res=None)
        cached, cached_cpu = self.render(folder + "/smoky_box.json", "box", res=None)
        path, cached = load(path, "beauty"), load(cached, "beauty")
        tell("smoky box: CPU seconds of a frame", cached_cpu, unit="s")
        tell("smoky box: mean", 100 * (cached[seen].mean() / mean - 1), unit="%")
        tell("smoky box: pixel error of beauty", 100 * error(cached), unit="%")
        tell("smoky box: path tracing to the same pixel error", path_cpu * (error(path) / error(cached))**2 / cached_cpu, 50,
             unit="times")

    def drafts(self):
        for name in ("smoke1", "wdas_cloud_sixteenth", "teapot_cloud"):
            vdb = f"{self.shared}/data/vdb/{name}.vdb"
            if not os.path.exists(vdb): print(f"{vdb} is not there: left out"); continue
            _, seconds = self.render(vdb, "draft", "--preset", "draft", res="640x480")
            tell(f"{name}.vdb: CPU seconds of a draft at 640x480", seconds, 9, True, "s")

    def marches(self):
        _, text = cpu([os.path.join(self.build, "bin/marcher_bench"), "--benchmark_filter=none"])
        bars = {"smoke1": (8, 13), "wdas_cloud_sixteenth": (8, 13), "teapot_cloud": (8, 13), "plume_512": (8, 13)}
        for line in text.splitlines():
            words = line.replace(",", "").split()
            if len(words) < 10 or words[3] != "rays/s" or words[0] not in bars or words[1] not in ("AVX2", "AVX3"): continue
            wanted = bars[words[0]] if words[1] == "AVX2" else (None, None)
            tell(f"march of {words[0]}, {words[1]}: rays/s of NanoVDB's HDDA", float(words[6]), wanted[0], unit="times")
            tell(f"march of {words[0]}, {words[1]}: of OpenVDB's intersector", float(words[9]), wanted[1], unit="times")

    def gathers(self):
        _, text = cpu([os.path.join(self.build, "bin/gather_bench"), "--benchmark_format=json"])
        speed = {b["name"].split("/min")[0]: b["rays"] for b in json.loads(text)["benchmarks"]}
        bare = speed["BareIntersect8"]
        tell("vacuum gather: of bare rtcIntersect8", speed["VacuumGather/gradients:0"] / bare, 0.8, unit="times")
        tell("vacuum gather with gradients: of the same", speed["VacuumGather/gradients:1"] / bare, unit="times")
        tell("gather in a medium with gradients: rays/s a core", speed["MediumGather/full:1"], unit="1/s")
        # Before footprints and drawn lamp samples it was 0.0145 of them (docs/decisions/0014).
        tell("gather in a medium: of what it was", speed["MediumGather/full:1"] / bare / 0.0145, 6, unit="times")

    def gradients(self):
        _, text = cpu([os.path.join(self.build, "bin/gradient_cost"), self.scenes()["demo"], "9", "100"])
        tell("gradients in media: cost of a gather, of Ward-Heckbert's", float(text.split("ward-heckbert ")[1].split()[0]), 1.04,
             True, "times")

    def threads(self):
        scenes = self.scenes(); scene = scenes.get("cornell_smoke1") or scenes["demo"]
        loop = "import hashlib\nfor _ in range(40): hashlib.pbkdf2_hmac('sha256', b'a', b'b', 100000)"

        def frame(n):  # Without reading files.
            _, text = cpu([self.brume, "render", scene, "-o", self.out + "/threads.exr", "--progress", "none", "--json",
                           "--res", "128x128", "-t", str(n)])
            seconds = json.loads(text)["seconds"]
            return seconds["total"] - seconds["load"]

        def arithmetic(n):
            start = time.time()
            for p in [subprocess.Popen([sys.executable, "-c", loop]) for _ in range(n)]: p.wait()
            return (time.time() - start) / n
        ratios = [2 * (frame(1) / frame(2)) / (arithmetic(1) / arithmetic(2)) for _ in range(3)]
        tell("two threads, where two loops of arithmetic gain 2", float(np.median(ratios)), 1.9, unit="times")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build"), parser.add_argument("shared"), parser.add_argument("out")
    parser.add_argument("--only"), parser.add_argument("--make-references", action="store_true")
    a = parser.parse_args(); bench = Bench(a.build, a.shared, a.out)
    if a.make_references: return bench.make_references()
    parts = {n: getattr(bench, n) for n in ("races", "box", "drafts", "marches", "gathers", "gradients", "threads")}
    for name in a.only.split(",") if a.only else parts: parts[name]()
    with open(os.path.join(a.out, "bench.json"), "w") as f: json.dump(rows, f, indent=1)


if __name__ == "__main__":
    main()
