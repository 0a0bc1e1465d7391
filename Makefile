# Two commands set everything up on a fresh machine: `make demo` and `make test`. They need Python 3.11 or newer and
# a C compiler; everything else goes into .venv.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
DEMO ?= scenarios/paper/hockenheim_normal.yaml --set road.surface=A
DATA ?= data/paper
EVALUATION_DATA ?= data/evaluation
HOUR_DATA ?= data/hour
EVALUATION ?= build/evaluation.json
SEARCH ?= docs/paper/search.json
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
SOURCES := pyproject.toml hatch_build.py $(wildcard fmu/*.py fmu/common/* fmu/vehicle/* fmu/sensor/*)

.PHONY: demo test check fmu cross dataset train search search-full validation evaluated paper bounds evaluation robustness closed-loop faults can regression manoeuvres roads benchmarks benchmark-network embedded sanitize clean study retrain-check

demo: $(VENV)/demo.stamp ## one lap of Hockenheim with the virtual sensor on board
	$(BIN)/cosim run $(DEMO)

test: $(VENV)/test.stamp ## linters, types, and all tests
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "Python 3.11 or newer is needed: make PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

$(VENV)/demo.stamp: $(SOURCES) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet -e '.[report]'
	touch $@

# torch goes first: its CPU build, where the machine offers one, must not be replaced by a larger build.
$(VENV)/test.stamp: $(SOURCES) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet torch==2.13.0
	$(BIN)/python -m pip install --quiet -e '.[test]'
	touch $@ $(VENV)/demo.stamp

check: $(VENV)/test.stamp ## formatting
	$(BIN)/ruff format --check .

fmu: $(VENV)/demo.stamp ## rebuild the FMUs after a change of the C sources
	$(BIN)/python fmu/build.py

cross: $(VENV)/demo.stamp ## vehicle FMUs for Linux, Windows and macOS in dist/, and the binaries of cosim pack --platform (the first time some ten minutes)
	$(BIN)/python -m pip install --quiet -e '.[cross]'
	$(BIN)/python fmu/cross.py

embedded: $(VENV)/test.stamp ## the C sensor on an emulated Cortex-M7 (needs gcc-arm-none-eabi, newlib, qemu-system-arm): docs/embedded.md
	$(ONE_THREAD) $(BIN)/python docs/measure/embedded.py

sanitize: $(VENV)/test.stamp ## lives and a million random calls of the vehicle FMUs under AddressSanitizer and UBSan
	FUZZ_CALLS=500000 $(BIN)/python -m pytest -q -s tests/test_fmu_sanitizers.py

validation: $(VENV)/test.stamp ## all gates of the vehicle, the slow ones too: docs/validation
	$(BIN)/python -m pip install --quiet -e '.[docs]'
	$(BIN)/python -m pytest -q tests/test_vehicle*.py tests/test_road*.py --validation docs/validation

dataset: $(VENV)/test.stamp ## data/paper, data/own, data/harder and data/evaluation (about ten minutes); runs that are there are kept
	for name in paper own harder evaluation; do \
	    $(BIN)/cosim sensor dataset scenarios/datasets/$$name.yaml --out data/$$name || exit; \
	done

train: dataset ## the shipped filters and networks (about three hours on one core); goes on where it was stopped
	$(BIN)/cosim sensor train sensor/recipes/fir.yaml --data data/own --out sensor/models
	$(BIN)/cosim sensor train sensor/recipes/paper.yaml --data data/paper --out build/training/bilstm_w19_ideal --resume
	$(BIN)/cosim sensor train sensor/recipes/bilstm_residual_w19_ideal.yaml --data data/own --out build/training/bilstm_residual_w19_ideal --resume
	$(BIN)/cosim sensor train sensor/recipes/bilstm_residual_w19_production.yaml --data data/own --out build/training/bilstm_residual_w19_production --resume
	for name in carried_ideal carried_production; do \
	    $(BIN)/cosim sensor train sensor/recipes/$$name.yaml --data data/own --data data/harder --out build/training/$$name --resume || exit; \
	done
	for name in bilstm_w19_ideal bilstm_residual_w19_ideal bilstm_residual_w19_production carried_ideal carried_production; do \
	    $(BIN)/cosim sensor export build/training/$$name/checkpoint.pt -o sensor/models/$$name.onnx || exit; \
	done

retrain-check: dataset ## every shipped network trained again with another seed: the same error within the seeds' spread?
	$(BIN)/python docs/measure/retrain_check.py --data data

study: dataset ## what makes the network with carried state good, three seeds: docs/carried-study.md (about half an hour on one core)
	$(ONE_THREAD) $(BIN)/python docs/measure/carried_study.py --data data/own --evaluation $(EVALUATION_DATA)

search: dataset ## the search over the network's shape in short: build/search/search.json (about an hour on one core); resumable
	$(BIN)/cosim sensor search sensor/recipes/search.yaml --data data/paper --out build/search

search-full: dataset ## the paper's whole search (days on one core); may be started on several machines at once
	$(BIN)/cosim sensor search sensor/recipes/search_full.yaml --data data/paper --out build/search_full --jobs 2

evaluated: $(VENV)/test.stamp ## every estimator on the runs of scenarios/datasets/evaluation.yaml; what is known already is kept
	$(BIN)/cosim sensor dataset scenarios/datasets/evaluation.yaml --out $(EVALUATION_DATA)
	$(BIN)/cosim sensor evaluate --data $(EVALUATION_DATA) --out $(EVALUATION)

paper: evaluated ## the paper's tables and figures beside ours: docs/paper.md
	$(BIN)/python -m pip install --quiet -e '.[docs]'
	$(ONE_THREAD) $(BIN)/python docs/measure/paper.py --evaluation $(EVALUATION) --data $(EVALUATION_DATA) --search $(SEARCH)

evaluation: evaluated ## all estimators on all cases, and the goals: docs/estimators-compared.md
	$(BIN)/python -m pip install --quiet -e '.[docs]'
	$(ONE_THREAD) $(BIN)/python docs/measure/estimators.py --evaluation $(EVALUATION) --data $(EVALUATION_DATA)

robustness: $(VENV)/test.stamp ## an hour, faulty channels, spinning wheels, slow errors: docs/robustness.md
	$(BIN)/cosim sensor dataset scenarios/datasets/evaluation.yaml --out $(EVALUATION_DATA)
	$(BIN)/cosim sensor dataset scenarios/datasets/hour.yaml --out $(HOUR_DATA)
	$(BIN)/python -m pip install --quiet -e '.[docs]'
	$(ONE_THREAD) $(BIN)/python docs/measure/robustness.py --data $(EVALUATION_DATA) --hour-data $(HOUR_DATA)

closed-loop: $(VENV)/test.stamp ## skyhook on truth and estimates, against the goals: docs/closed-loop.md (some minutes)
	$(BIN)/python -m pip install --quiet -e '.[docs]'
	$(ONE_THREAD) $(BIN)/python docs/measure/closed_loop.py

faults: $(VENV)/test.stamp ## what faults and latencies do to estimate and ride: docs/faults.md (some minutes)
	$(ONE_THREAD) $(BIN)/python docs/measure/fault_scenarios.py

can: $(VENV)/test.stamp ## the sensor on a CAN bus, its frames and what they cost: docs/can.md (some minutes)
	$(ONE_THREAD) $(BIN)/python docs/measure/can_bus.py

regression: $(VENV)/test.stamp ## every shipped scenario by its limits and goldens: build/regression/junit.xml, verdicts.txt (about ten minutes on two busy cores)
	mkdir -p build/regression
	{ $(BIN)/cosim test scenarios --junitxml build/regression/junit.xml --output-dir build/regression/results 2>&1; \
	    echo $$? > build/regression/exit_code; } | tee build/regression/verdicts.txt; \
	    exit $$(cat build/regression/exit_code)

manoeuvres: $(VENV)/test.stamp ## how the paper's manoeuvres were driven: docs/paper-scenarios.md (about a minute)
	$(ONE_THREAD) $(BIN)/python docs/measure/manoeuvres.py

kalman: $(VENV)/test.stamp ## the Kalman filters of sensor/models (about five minutes)
	$(BIN)/cosim sensor kalman --out sensor/models

bounds: $(VENV)/test.stamp ## what can be known at all, from the Riccati equation: docs/bounds.md (about three minutes)
	$(ONE_THREAD) $(BIN)/python docs/measure/bounds.py --data $(EVALUATION_DATA)

roads: $(VENV)/test.stamp ## surfaces, bumpy road and road scenarios: the tables of docs/roads.md (about four minutes)
	OMP_NUM_THREADS=1 $(BIN)/python docs/measure/surfaces.py
	OMP_NUM_THREADS=1 $(BIN)/python docs/measure/bumps.py
	OMP_NUM_THREADS=1 $(BIN)/python docs/measure/road_scenarios.py

benchmarks: $(VENV)/test.stamp ## real-time factors, loop overhead beside FMPy's, the network, a batch, the vehicle's instructions (needs valgrind)
	$(ONE_THREAD) $(BIN)/python tests/benchmarks/bench_loop.py
	$(ONE_THREAD) $(BIN)/python tests/benchmarks/bench_network.py
	$(BIN)/python tests/benchmarks/bench_batch.py
	$(BIN)/python tests/benchmarks/bench_instructions.py

benchmark-network: $(VENV)/test.stamp ## the networks in every run time: docs/performance-network.md (about five minutes; OpenVINO and valgrind if they are there)
	$(ONE_THREAD) $(BIN)/python tests/benchmarks/bench_network.py --write

clean:
	rm -rf build dist results cosim/fmus $(VENV)/*.stamp
