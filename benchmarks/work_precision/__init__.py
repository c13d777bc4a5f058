"""Work against precision of gauss and of other engines, on the same scenes, in one run.

Run it with:

    python -m benchmarks.work_precision [--patience 0.3] [--scene NAME] [--fresh | --report]

Every scene is moved by every method with settings from coarse to fine. The error is how far the centres of mass are from
where a reference has them at the end, the largest of all [m]. Runs are timed on a wall clock, the best of up to four; the
time to make machine code stands apart. What is in benchmarks/results/work_precision.csv already is not measured again; with
``--report`` nothing is, and the report, the charts and a section of benchmarks/README.md are made of what is there.

Settings of the peers:

* Pinocchio: wheel of PyPI; ``pin.aba``, stepped by SciPy's DOP853 and LSODA in Python; open chains only.
* MuJoCo: wheel of PyPI; the scene as gauss exports it, everything that the scene does not need disabled; steps in C. Loops
  are closed by its soft constraints, made as stiff as the step allows (time constant of two steps).
* Exudyn: wheel of PyPI; rigid bodies with rotation vectors, joints as constraints; generalised-α of index 3 with its Newton
  settings as they come.
* Drake: wheel of PyPI; a MultibodyPlant in continuous time, body by body; its runge_kutta3, runge_kutta5 and radau3 with
  error control, ``target_accuracy`` from 1e-3 on, steps of up to a tenth of the duration; laws of drives as its symbolic
  expressions; balls by roll, pitch and yaw. Trees only: in continuous time it has no constraints.
* heyoka: Taylor's method in double precision, on the accelerations as gauss traces them, without projection; straight-line
  code where these are short. Its time is that of ``propagate_until`` alone, that of gauss a whole ``gauss.simulate``, or, of
  methods marked "prepared", a call of what ``gauss.prepare`` returns.
"""
