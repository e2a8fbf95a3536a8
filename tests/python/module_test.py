#!/usr/bin/env python3
"""The Python module against the closed forms that the command's tests use, and against the files it writes."""
import os
import signal
import tempfile
import unittest

import numpy as np

import crampfit

SCENE = """
[model]
plane = "strain"
thickness = "10 mm"
cell = "0.5 mm"
points_per_cell = 4
[specimen]
size = ["10 mm", "10 mm"]
material = "EW"
[materials.EW]
kind = "isotropic"
E = "40 MPa"
nu = 0.33
density = "300 kg/m^3"
toughness = "100 J/m^2"
[[edges]]
name = "top"
side = "top"
velocity = ["0 m/s", "1 mm/min"]
[[edges]]
name = "bottom"
side = "bottom"
velocity = ["0 m/s", "0 m/s"]
[[cracks]]
points = [["10 mm", "5 mm"], ["7.5 mm", "5 mm"]]
grows = "end"
advance = "1 mm"
direction = "straight"
[measure]
force = "top"
displacement = "top"
[stop]
displacement = "1 mm"
[output]
frames = 2
"""

PARAMETERS = """
[[parameters]]
name = "toughness"
key = "materials.EW.toughness"
initial = "80 J/m^2"
lower = "50 J/m^2"
upper = "110 J/m^2"
scale = "log"
[[parameters]]
name = "modulus"
key = "materials.EW.E"
initial = "50 MPa"
lower = "40 MPa"
upper = "80 MPa"
"""


class Module(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.write("scene.toml", SCENE)

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, text):
        with open(self.path(name), "w", encoding="utf-8") as file:
            file.write(text)
        return self.path(name)

    def test_simulate(self):
        record = crampfit.simulate(self.path("scene.toml"))
        stiffer = crampfit.simulate(self.path("scene.toml"), set={"materials.EW.E": "160 MPa"})
        self.assertEqual(record.status, "split")
        series, stiff = record.table("series"), stiffer.table("series")
        self.assertEqual(series["force_N"].dtype, np.float64)
        # Peak force goes with sqrt(E Gc) (Griffith 1921).
        self.assertAlmostEqual(stiff["force_N"].max() / series["force_N"].max(), 2.0, places=9)
        self.assertIn("path", record.tables)
        self.assertEqual(record.frames[-1]["moved_m"].shape, record.points.shape)
        record.save(self.path("record.h5"))
        again = crampfit.load(self.path("record.h5")).table("series")
        for name, column in series.items():
            np.testing.assert_array_equal(again[name], column)
        self.assertIn("equilibrium", crampfit.explain(self.path("scene.toml")).lower())

    def test_evaluate_and_sensitivity(self):
        study = self.write("study.toml", 'scene = "scene.toml"\noutputs = ["peak force", "initial stiffness"]\n' + PARAMETERS)
        outputs, slopes = crampfit.evaluate(study, {"modulus": 60.0}, gradient=True)
        np.testing.assert_allclose(slopes * np.array([80.0, 60.0]) / outputs[:, None], [[0.5, 0.5], [0, 1]], atol=1e-6)
        indices = crampfit.sensitivity(study, threads=1).table("indices")
        elasticity = indices["value"][indices["kind"] == "elasticity"]
        np.testing.assert_allclose(elasticity, [0.5, 0.5, 0, 1], atol=1e-6)

    def test_fit(self):
        series = crampfit.simulate(self.path("scene.toml"), set={"materials.EW.E": "60 MPa", "materials.EW.toughness": "100 J/m^2"}).table(
            "series")
        rows = "".join(f"{1e3 * u},{f}\n" for u, f in zip(series["displacement_m"], series["force_N"]))
        self.write("pull.csv", "displacement [mm],force [N]\n" + rows)
        study = self.write("study.toml", '[[experiments]]\nscene = "scene.toml"\ndata = "pull.csv"\nnoise = { force = "0.1 N" }\n' + PARAMETERS)
        fit = crampfit.fit(study, threads=1)
        self.assertEqual(fit.status, "converged", fit.message)
        np.testing.assert_allclose(fit.table("parameters")["value"], [100, 60], rtol=1e-6)
        self.assertEqual(fit.covariance.shape, (2, 2))
        self.assertFalse(fit.table("parameters")["at_bound"].any())
        fit.save(self.path("fit.h5"))
        self.assertEqual(crampfit.load(self.path("fit.h5")).misfit, fit.misfit)

    def test_bad_input(self):
        with self.assertRaisesRegex(crampfit.InputError, "materials.EW.E"):
            crampfit.simulate(self.path("scene.toml"), set={"materials.EW.E": "40 mm"})
        with self.assertRaisesRegex(ValueError, "no such file|cannot be"):
            crampfit.simulate(self.path("none.toml"))
        study = self.write("study.toml", 'scene = "scene.toml"\noutputs = ["peak force"]\n' + PARAMETERS)
        with self.assertRaisesRegex(crampfit.InputError, "no parameter of the study"):
            crampfit.evaluate(study, {"modulos": 1.0})
        for outside in (-5.0, 500.0, float("nan")):
            with self.assertRaisesRegex(crampfit.InputError, "modulus.*must lie within the study's bounds, 40 to 80 MPa"):
                crampfit.evaluate(study, {"modulus": outside})
        np.testing.assert_array_equal(crampfit.evaluate(study, {"modulus": 80.0}).shape, [1])  # a bound is within
        with self.assertRaisesRegex(crampfit.InputError, "needs `keep`"):
            crampfit.fit(study, resume=True)
        record = crampfit.simulate(self.path("scene.toml"))
        with self.assertRaisesRegex(crampfit.InputError, "file of another kind"):
            record.save(self.path("scene.toml"))
        with open(self.path("scene.toml"), encoding="utf-8") as scene:
            self.assertEqual(scene.read(), SCENE)
        self.assertEqual(repr(record), "<crampfit.Record: split>")

    def test_settings_of_any_type(self):
        plain = crampfit.simulate(self.path("scene.toml"), set={"model.points_per_cell": "9", "solver.extrapolate": "false"}, threads=2)
        typed = crampfit.simulate(
            self.path("scene.toml"),
            set={
                "model.points_per_cell": np.int64(9),
                "solver.extrapolate": np.bool_(False),
                "specimen.size": ("10 mm", "10 mm"),
                "cracks.0.faces": {"friction": 0.0},
                "edges.1": {"name": "Fläche \U0001f332", "side": "bottom", "velocity": ["0 m/s", "0 m/s"]},
            },
        )
        np.testing.assert_array_equal(typed.table("series")["force_N"], plain.table("series")["force_N"])
        self.assertEqual(len(typed.points), 400 * 9)

    def test_what_a_signal_raises(self):
        def late(number, frame):
            raise TimeoutError("too late")

        before = signal.signal(signal.SIGALRM, late)
        self.addCleanup(signal.signal, signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with self.assertRaisesRegex(TimeoutError, "too late"):
            crampfit.simulate(self.path("scene.toml"), set={"model.cell": "0.05 mm"})


if __name__ == "__main__":
    unittest.main()
