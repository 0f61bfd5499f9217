# Every target sets up what it needs by itself: `make molds` the CAD side only, `make test` everything.
VENV := .venv
BIN := $(VENV)/bin
# An empty one, of the environment or typed, is none: a recipe that began with "-m" would run another program, m.
override PYTHON := $(or $(strip $(PYTHON)),$(shell command -v python3.11 || command -v python3.12 || command -v python3.13 || command -v python3))
PIP := $(BIN)/python -m pip --disable-pip-version-check -q
OCP := $(shell sed -n 's/^\(cadquery-ocp==.*\)/\1/p' lock.txt)
TORCH := $(shell sed -n 's/^\(torch==.*\)/\1/p' lock.txt)
.DEFAULT_GOAL := help
.NOTPARALLEL: # under -j too: `make molds sheet` in the order in which they are typed; programs take the cores themselves
.DELETE_ON_ERROR: # an environment without pip, above all: the next run makes it anew
FAB := molds molds-help slice sheet ring coupons design
GOALS := help setup $(FAB) endcap robot-model study data train evaluate live test test-long quick check docs bench clean clean-all
.PHONY: $(GOALS)

# Everything on the command line is read or refused: a word that is no target, a variable that no target here takes.
STRANGE := $(filter-out $(GOALS),$(foreach goal,$(MAKECMDGOALS),$(if $(findstring /,$(goal)),,$(goal))))
$(if $(STRANGE),$(error $(STRANGE): not a target (`make help` lists them); give sizes by name: make molds D=150 T=9))
DOTS := dots dot_mm
TAKES_data := N D T $(DOTS) material WORKERS OPTIONS
TAKES_train := D T $(DOTS) material WORKERS
TAKES_evaluate := D T $(DOTS) material WORKERS OPTIONS
TAKES_live := D T $(DOTS) material OPTIONS
TAKES_study := D T $(DOTS) gyroid material load error exports
TAKES_endcap := D T $(DOTS) gyroid material joint_clearance robot printer exports
TAKES_robot-model := D T $(DOTS) gyroid material joint_clearance robot friction exports
TAKES_clean-all := SURE
TAKEN := PYTHON VENV $(foreach goal,$(MAKECMDGOALS),$(TAKES_$(goal)))
TYPED := $(foreach name,$(.VARIABLES),$(if $(filter command,$(firstword $(origin $(name)))),$(name)))
UNTAKEN := $(if $(filter $(FAB),$(MAKECMDGOALS)),,$(filter-out $(TAKEN),$(TYPED)))
$(if $(UNTAKEN),$(error $(UNTAKEN): not a variable of `make $(MAKECMDGOALS)`, which takes $(strip $(TAKEN)); capitals count))
SENSES := $(firstword $(filter data train evaluate live study,$(MAKECMDGOALS)))
$(if $(SENSES),$(if $(D),$(if $(T),,$(error D without T: give both, as in make $(SENSES) D=150 T=9)),\
  $(if $(T),$(error T without D: give both, as in make $(SENSES) D=150 T=9))))
# D, T and material of a command of sensing; the shell reads their values out of its environment, as they were typed.
DOTTED = $(if $(dots),--dot-rings "$$dots") $(if $(dot_mm),--dot-mm "$$dot_mm")
DESIGN = $(if $(D),--diameter "$$D" --wall "$$T") $(DOTTED) $(if $(material),--silicone "$$material")
OTHER = $(D)$(material)$(dots)$(dot_mm)
# Of another camera module than the released one weights and test data are others, too, and lie apart.
CAMERA := $(filter-out ELP-USBFHD01M-L180,$(ENDCAP_CAMERA))
OWN = $(OTHER)$(CAMERA)
# fab's commands read the variables themselves, as they were typed, out of MAKEFLAGS: no shell comes between.
ASKED := --make-variables

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14
	@echo 'make molds D=130 T=8 writes exports/D130_T8; `make molds-help` lists its options'

setup: $(VENV)/all.stamp ## virtual environment with everything

molds: $(VENV)/fab.stamp ## print and cast files of one endcap: make molds D=130 T=8
	@$(BIN)/python -m fab.molds $(ASKED)

slice: $(VENV)/fab.stamp ## slicer projects, sliced and measured: make slice D=130 T=8
	@sh scripts/slicer.sh
	@$(BIN)/python -m fab.slice $(ASKED)

sheet: $(VENV)/fab.stamp ## build sheet as HTML and PDF, BOM and recipe: make sheet D=130 T=8
	@$(BIN)/python -m fab.build_sheet $(ASKED)

molds-help: $(VENV)/fab.stamp
	@$(BIN)/python -m fab.molds --help

ring: $(VENV)/fab.stamp ## LED ring: board files, BOM, electrical budget, light on the dome
	@$(BIN)/python -m fab.led_ring $(ASKED)

design: $(VENV)/fab.stamp ## a page with sliders for D and T: preview, mass, cost, and a button that makes the files
	@$(BIN)/python -m fab.design_page $(ASKED)

data: $(VENV)/all.stamp ## labelled, rendered frames: make data N=2000 [D=130 T=8 material=... WORKERS=2 OPTIONS='--help']
	@$(BIN)/python -m sensing.simulator data --workers "$${WORKERS:-2}" $(if $(N),--frames "$$N") $(DESIGN) \
	  $(if $(OTHER),--loads design) $(OPTIONS)

WRENCH := exports/wrench_train/small.safetensors
WRENCH_DATA := exports/wrench_train exports/wrench_motion
SIMULATE = $(BIN)/python -m sensing.simulator data --workers "$${WORKERS:-2}" --tolerance 1e-3
# With D and T, or another camera: weights by similarity, where live finds them. Without: a simulation of your own.
train: $(if $(OWN),$(VENV)/all.stamp,$(WRENCH)) ## weights: make train D=180 T=10 [material=...] (minutes)
	@$(if $(OWN),$(BIN)/python -m sensing.train --design "$${D:-130}" "$${T:-8}" \
	  $(DOTTED) $(if $(material),--silicone "$$material"),true)

# Of another design: pressed in proportion to the range of its weights.
TESTED = exports/wrench_test$(if $(OWN),_D$${D:-130}_T$${T:-8}$(if $(dots),_$${dots})$(if $(dot_mm),_$${dot_mm})$(if $(material),_$${material})$(if $(CAMERA),_$${ENDCAP_CAMERA}))
evaluate: $(if $(OWN),$(VENV)/all.stamp,$(WRENCH)) ## errors of the weights on motions never seen: make evaluate [D=180 T=10 material=...]
	@$(SIMULATE) --frames 1 --seed 101 --protocol dynamic $(DESIGN) $(if $(OWN),--loads design) --out "$(TESTED)"
	@$(BIN)/python -m sensing.evaluate "$(TESTED)" \
	  $(if $(OWN),,--weights $(WRENCH) --train $(WRENCH_DATA)) $(OPTIONS)

$(WRENCH): $(VENV)/all.stamp
	@$(SIMULATE) --frames 1600 --seed 1 --out exports/wrench_train
	@$(SIMULATE) --frames 1 --seed 2 --protocol dynamic --out exports/wrench_motion
	@$(BIN)/python -m sensing.train $(WRENCH_DATA) --out $@

live: $(VENV)/all.stamp ## wrench and contact, live: make live [D=180 T=10 OPTIONS='--camera 0,2,4'] (simulated robot without)
	@$(BIN)/python -m sensing.live $(DESIGN) $(OPTIONS)

study: $(VENV)/all.stamp ## what a design will feel, before printing: make study D=130 T=8; the map of all: make study
	@$(BIN)/python -m sensing.study $(foreach name,D T dots dot_mm gyroid material load error exports,$(if $($(name)),"$(name)=$$$(name)"))

endcap: $(VENV)/all.stamp ## everything of one size in one folder: molds, slices, sheet, ring, weights, study: make endcap D=180 T=10
	@sh scripts/slicer.sh || echo 'slicer projects will be left out' >&2
	@$(BIN)/python -m endcap.whole $(ASKED)

robot-model: $(VENV)/all.stamp ## endcap for robot simulators, MJCF and URDF: make robot-model D=130 T=8
	@$(BIN)/python -m endcap.robot_model $(ASKED)

coupons: $(VENV)/fab.stamp ## fit coupon for the joints, bond specimens and their trays
	@$(BIN)/python -m fab.coupons $(ASKED)

# Three processes on two cores: tests wait for cameras, browsers and processes. Each imports all test modules: a fourth
# takes 30 s of processor time more, 80 the first time, and no less of the clock.
test: $(VENV)/all.stamp ## the tests, but for those marked long: nine minutes on two slow cores, the first time ten; half of that on quick ones
	@sh scripts/slicer.sh || echo 'tests that slice will be skipped' >&2
	@$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder -m 'not long'

test-long: $(VENV)/all.stamp ## the rest of the tests: more sizes, more seeds, other engines, all kernels compiled anew: nine minutes on two slow cores
	@sh scripts/slicer.sh || echo 'tests that slice will be skipped' >&2
	@$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder -m long

# Quick: what makes no CAD solids, renders nothing and presses nothing. 80 s of processor time with warm caches.
QUICK := $(addprefix tests/,test_architecture.py test_words.py test_provenance.py test_extras.py test_makefile.py \
  test_endcap_command.py docs/test_pages.py $(addprefix cad/,test_params.py test_dots.py test_materials.py \
  test_mold_layout.py test_plain_numbers.py) $(addprefix fab/,test_whole_folder.py test_clean.py test_bond_tests.py \
  test_cache.py led_ring/test_driver.py) $(addprefix sensing/,test_frames.py test_records.py test_records_labelled.py \
  camera sources wrench/test_contact.py wrench/test_filter.py wrench/test_quantiles.py wrench/test_model.py \
  tracking/test_nearest.py tracking/test_dots.py tracking/test_zero.py))
define LINT
@$(BIN)/ruff check .
@$(BIN)/ruff format --check .
endef

quick: $(VENV)/all.stamp ## lint, architecture and the quick tests, in about a minute
	$(LINT)
	@$(BIN)/python -m pytest -n 2 --dist loadfile $(QUICK)

check: $(VENV)/all.stamp ## lint and types
	$(LINT)
	@$(BIN)/mypy

# Without --quiet: it would hide the warnings that --strict counts.
docs: $(VENV)/docs.stamp ## documentation site in build/site, strictly: broken links stop it
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo build/site/index.html

bench: $(VENV)/all.stamp ## speed against error: CSV and plots under bench/
	@failed=; for script in bench/bench_*.py; do echo $$script; $(BIN)/python $$script || failed="$$failed $$script"; done; \
	test -z "$$failed" || { echo "failed, or needs data or a library (see its --help):$$failed" >&2; exit 1; }

define REMOVE_BUILT
@test ! -e $(VENV)/fab.stamp -a ! -e $(VENV)/docs.stamp || rm -rf $(VENV)
@rm -rf build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
@find . -name __pycache__ -type d -prune -exec rm -rf {} +
endef

clean: ## remove what one command makes again; recordings, data, weights and files of your own stay
	@$(PYTHON) -m fab.clean
	$(REMOVE_BUILT)

clean-all: ## everything in exports/ too, files of your own included: make clean-all SURE=yes
	@$(PYTHON) -m fab.clean --all $(if $(filter yes,$(SURE)),--sure)
	$(REMOVE_BUILT)

$(VENV)/bin/python:
	@sh scripts/system_libraries.sh
	@$(PYTHON) -c 'import sys; ok = (3, 11) <= sys.version_info[:2] < (3, 14); sys.exit(0 if ok else "Python 3.11, 3.12 or 3.13 is needed, found %d.%d: name one with make PYTHON=..." % sys.version_info[:2])'
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || \
	  sh scripts/debian_packages.sh 'venv of Python' "python$$($(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])')-venv"
	@echo "setting up $(VENV) (once; some minutes)" >&2
	@$(PYTHON) -m venv $(VENV)

$(VENV)/fab.stamp: pyproject.toml lock.txt scripts/prove_kernel.py | $(VENV)/bin/python
	@$(PIP) install -c lock.txt -e '.[cad]'
	@$(PIP) install --force-reinstall --no-deps $(OCP)
	@$(BIN)/python scripts/prove_kernel.py
	@touch $@

$(VENV)/all.stamp: $(VENV)/fab.stamp
	@$(PIP) install -c lock.txt $(TORCH)
	@$(PIP) install -c lock.txt -e '.[dev]'
	@$(PIP) install --force-reinstall --no-deps $(OCP)
	@$(BIN)/python scripts/prove_kernel.py
	@touch $@

$(VENV)/docs.stamp: pyproject.toml lock.txt | $(VENV)/bin/python
	@$(PIP) install -c lock.txt -e '.[docs]'
	@touch $@
