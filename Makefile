# One command each; every target sets up what it needs. System packages that are missing are named.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
RUNS := $(VENV)/runs
READY := $(VENV)/ready
SYSTEM_PYTHON ?= /usr/bin/python3
STATE ?= .state
PEERS := .venv-bench
WHEELS := build/wheel
SOURCES := build/source
DEB := dist/deb
# One more than there are processors: tests of whole daemons and of the page wait for half of their time.
WORKERS ?= $(shell expr $$(nproc) + 1)
NODE := node_modules/ready
PAGE_TYPES := src/grabberd/server/web/types/openapi.d.ts
PAGE_SOURCES = $(shell find src/grabberd/server/web/static/js src/grabberd/server/web/types tests/server/web/types -type d -o -name '*.js' -o -name '*.ts')
SITE := src/grabberd/server/web/site/index.html
SITE_SOURCES = README.md CHANGELOG.md $(shell find docs src/grabberd/library -name '*.md' -o -name '*.ipynb' -o -name '*.py' -o -name '*.png' -o -name '*.svg')
# Tests of the virtual machine by what they need: the Debian package, the installed service, or the driver alone.
OF_PACKAGE := test_deb.py test_first_day.py
OF_SERVICE := $(notdir $(wildcard tests/proofs/vm/test_service_*.py))
OF_DRIVER := $(filter-out $(OF_PACKAGE) $(OF_SERVICE),$(notdir $(wildcard tests/proofs/vm/test_*.py)))
IN_VM = OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest $(addprefix tests/proofs/vm/,$(1)) $(if $(WRITE),--write-tables)
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1

.PHONY: help run test check check-page types npm pytest test-affected test-browser test-installed browser mosquitto ffmpeg promtool screenshots test-vm test-vm-driver test-vm-service test-wheel test-pythons sizes test-install test-deb test-vm-deb test-container wheel sdist deb check-units install rollback uninstall bundle bench profile measured soak soak-clients soak-load soak-faults armour hostile faults fuzz setups footage audit world house walls docs site format lock clean

help:  ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 20

run: $(RUNS)  ## start the daemon on the simulated grabber at http://127.0.0.1:8050 (PORT=8051: at another one)
	@STATE_DIRECTORY="$(abspath $(STATE))" GRABBERD_URL= $(BIN)/grabberd profile import --examples >/dev/null
	@echo "Starting the daemon on the simulated grabber; its captures are in $(STATE)/. Ctrl-C ends it."
	@STATE_DIRECTORY="$(abspath $(STATE))" exec $(BIN)/grabberd serve $(if $(PORT),--port $(PORT))

test: $(READY) npm  ## every check, and the tests of everything but the page in a browser, installations and the virtual machine
	@$(MAKE) --no-print-directory check
	@$(MAKE) --no-print-directory pytest

# Installations wait for the disk, the network and each other's single processes: side by side they leave no processor idle.
test-installed: wheel sdist  ## the wheel, the source archive and the bundle, each installed into an empty place
	@$(MAKE) --no-print-directory --jobs 2 --output-sync=target test-wheel test-install

check: $(READY) check-page site  ## ruff, mypy, the arrows between the rooms and the page's types
	$(BIN)/ruff format --check src drivers systemd tests docs tools
	$(BIN)/ruff check src drivers systemd tests docs tools
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/python -m tests.house.glossary
	$(BIN)/python -m tests.house.docstrings
	@systemd/check-units.sh

check-page: npm  ## the page's modules against the types of the API
	@! command -v npm >/dev/null || $(MAKE) --no-print-directory node_modules/page-checked

types: npm  ## the page's types, from docs/reference/openapi.json
	@! command -v npm >/dev/null || { $(MAKE) --no-print-directory $(NODE) && npm run --silent types; }

# Installs a Debian package where root may, or says what is not tested without it: command, package, consequence.
define installed
	@PATH=$$PATH:/usr/sbin command -v $(1) >/dev/null || { test "$$(id -u)" = 0 && command -v apt-get >/dev/null \
	  && { apt-get install --yes --no-install-recommends $(2) || { apt-get update && apt-get install --yes --no-install-recommends $(2); }; } ; } \
	  || echo "*** $(2) is missing, so $(3): sudo apt-get install $(2) ***"
endef

# Where the environment forbids bytecode, each of the many daemons in the tests would compile all modules anew.
# A service has ten threads; what they leave in glibc's arenas, of which there are sixteen, would stay for ever.
pytest: $(READY) mosquitto ffmpeg mkvtoolnix promtool  ## the tests alone, on all processors
	PYTHONDONTWRITEBYTECODE= MALLOC_ARENA_MAX=2 $(BIN)/python -m pytest --numprocesses $(WORKERS) --dist loadfile --no-loadscope-reorder

test-browser: $(READY) browser  ## the operator's page in a real browser, before a real daemon
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest tests/browser -rs --numprocesses auto --dist loadfile --no-loadscope-reorder

screenshots: $(READY) browser  ## pictures of every panel of the page, into docs/images/page
	PYTHONPATH=tests:tests/support $(BIN)/python -m browser.screenshots docs/images/page $(NAMES)

browser:
	$(call installed,chromium,chromium,the page is NOT tested)

test-affected: $(READY)  ## the tests nearest to what this branch changes, in half a minute (BASE=commit, TEST_SECONDS=60)
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m tests.affected $(if $(BASE),--base $(BASE)) $(if $(TEST_SECONDS),--seconds $(TEST_SECONDS))

mosquitto:
	$(call installed,mosquitto,mosquitto,the MQTT publisher is NOT tested)

ffmpeg:
	$(call installed,ffprobe,ffmpeg,interlaced videos are NOT tested)

mkvtoolnix:
	$(call installed,mkvpropedit,mkvtoolnix,the marks of Matroska files are NOT tested)

# Unpacked, not installed: Debian's package would start a Prometheus of its own.
promtool:
	@command -v promtool >/dev/null || test -x $(VENV)/promtool/usr/bin/promtool || { command -v apt-get >/dev/null \
	  && mkdir -p $(VENV)/promtool && cd $(VENV)/promtool && apt-get download --quiet=2 prometheus \
	  && dpkg-deb --fsys-tarfile prometheus_*.deb | tar x ./usr/bin/promtool && rm prometheus_*.deb ; } \
	  || echo "*** promtool is missing, so alert rules and dashboard are NOT tested: sudo apt-get install prometheus ***"

npm:
	$(call installed,npm,npm,the page's types are NOT checked)

# A machine that keeps time has one processor, so two of them leave none idle.
test-vm: $(READY)  ## driver and service under a real kernel and systemd, in a virtual machine (WRITE=1: results into docs/)
	@$(MAKE) --no-print-directory --jobs 2 --output-sync=target test-vm-driver test-vm-service

test-vm-driver: $(READY)  ## the driver alone, before the kernel's own and emulated devices
	$(call IN_VM,$(OF_DRIVER))

test-vm-service: $(READY)  ## the installed service alone
	$(call IN_VM,$(OF_SERVICE))

test-vm-deb: deb  ## the Debian package in the same machine: installed, captures, purged; a new user's first day with it (WRITE=1: into docs/)
	$(call IN_VM,$(OF_PACKAGE))

test-wheel: wheel sdist  ## install wheel and source archive, with a compiler and without, into an empty environment; capture there
	@! ls $(WHEELS)/grabberd-*abi3*.whl >/dev/null 2>&1 || $(BIN)/abi3audit --strict $(WHEELS)/grabberd-*.whl
	bash tests/wheel/install_and_capture.sh "$(PYTHON)" $(WHEELS)/grabberd-*.whl $(SOURCES)/grabberd-*.tar.gz

test-pythons: wheel  ## the wheel in every Python from 3.11 on that this machine has
	bash tests/wheel/every_python.sh $(WHEELS)/grabberd-*.whl

test-install: wheel  ## pack a bundle, install it into an empty root without internet, upgrade and remove it there
	WHEEL=$$(echo $(WHEELS)/grabberd-*.whl) bash tests/systemd/bundle_and_install.sh "$(SYSTEM_PYTHON)" "$(BIN)/python"

sizes: wheel $(if $(WRITE),sdist deb)  ## how large each package of an installation is, and which of them a daemon loads (WRITE=1: into docs/)
	@rm -rf build/sizes && $(PYTHON) -m venv build/sizes
	@build/sizes/bin/python -m pip install --quiet --no-compile --constraint constraints.txt $(WHEELS)/grabberd-*.whl
	@build/sizes/bin/python tests/wheel/sizes.py $(if $(WRITE),docs/reference/sizes.md) 2>build/sizes/log || { cat build/sizes/log; exit 1; }

test-deb: wheel  ## make the Debian package twice, compare, ask lintian; install it into an empty root and capture there
	@WHEEL=$$(echo $(WHEELS)/grabberd-*.whl) bash tests/systemd/make_and_check_deb.sh "$(SYSTEM_PYTHON)" $(BIN)/python

test-container: wheel  ## build the image and run it, where podman or buildah can
	@WHEEL=$$(echo $(WHEELS)/grabberd-*.whl) bash tests/container/build_and_run.sh $(BIN)/python

wheel: $(READY) site  ## the wheel, tagged for the oldest glibc that its kernel runs with, into build/wheel
	@rm -rf $(WHEELS)
	@$(BIN)/python -m build --wheel --outdir $(WHEELS)/built . >$(VENV)/wheel.log 2>&1 || { cat $(VENV)/wheel.log; exit 1; }
	@PATH="$(abspath $(BIN)):$$PATH" auditwheel repair --wheel-dir $(WHEELS) $(WHEELS)/built/*.whl >>$(VENV)/wheel.log 2>&1 \
	  || { echo "wheel: tagged for computers like this one alone: $$(tail -1 $(VENV)/wheel.log)"; cp $(WHEELS)/built/*.whl $(WHEELS); }

sdist: $(READY) site  ## the source archive, with the documentation's site, into build/source
	@rm -rf $(SOURCES)
	@$(BIN)/python -m build --sdist --outdir $(SOURCES) . >$(VENV)/source.log 2>&1 || { cat $(VENV)/source.log; exit 1; }

check-units:  ## whether systemd accepts the units, and how exposed it finds the daemon
	@systemd/check-units.sh

install:  ## install into /opt/grabberd as a service, or upgrade it there (DESTDIR=: into another root)
	@DESTDIR="$(DESTDIR)" PYTHON="$(SYSTEM_PYTHON)" sh systemd/installer.sh install "$(CURDIR)" constraints.txt

rollback:  ## go back to the release before the latest installation
	@DESTDIR="$(DESTDIR)" PYTHON="$(SYSTEM_PYTHON)" sh systemd/installer.sh rollback

uninstall:  ## remove the service; captures and configuration stay
	@DESTDIR="$(DESTDIR)" sh systemd/installer.sh uninstall

bundle: wheel  ## pack wheels and installer for a computer without internet, into dist/
	@WHEEL=$$(echo $(WHEELS)/grabberd-*.whl) bash systemd/bundle.sh $(BIN)/python dist

deb: $(READY) wheel  ## make a Debian package, with what is in it (CycloneDX) and digests, into dist/deb
	@rm -rf $(DEB)
	@WHEEL=$$(echo $(WHEELS)/grabberd-*.whl) bash systemd/bundle.sh $(BIN)/python $(DEB)/bundle >/dev/null
	@bash systemd/deb.sh $(DEB)/bundle/grabberd-*.tar.gz "$(SYSTEM_PYTHON)" $(DEB)
	@rm -rf $(DEB)/bundle

site: $(SITE)  ## build the documentation as a site, strictly; a daemon serves it at /docs

$(SITE): mkdocs.yml $(SITE_SOURCES) | $(READY)
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

bench: $(READY) $(PEERS)/ready  ## beside OpenCV, OpenPTV, scipy, scikit-image and trackpy, into docs/benchmarks.md (four minutes)
	$(ONE_THREAD) $(BIN)/python -m tests.proofs.bench.peers --write

profile: $(READY)  ## where a field's time goes: stages and functions
	$(ONE_THREAD) $(BIN)/python -m tests.proofs.bench.hot_path

measured: $(READY)  ## accuracy and cost of every part of the work, into docs/measured.md (many minutes)
	OPENBLAS_NUM_THREADS=1 PYTHONPATH=tests $(BIN)/python -m tests.proofs.bench all --seconds $(or $(DURATION),60) --write docs/measured.md

soak: $(READY)  ## ten minutes (or DURATION=… seconds) at 50 Hz, clients coming and going; LOAD=4: beside busy loops (DEVICES=4); FAULTS=1: twenty, a fault every few seconds; fails where a promise is broken
	@$(MAKE) --no-print-directory $(if $(FAULTS),soak-faults,$(if $(LOAD),soak-load,soak-clients))

soak-clients: $(READY)
	OPENBLAS_NUM_THREADS=1 PYTHONPATH=tests $(BIN)/python -m tests.proofs.bench soak --seconds $(or $(DURATION),600) $(if $(SEED),--seed $(SEED)) --write docs/measured.md

soak-load: $(READY)
	OPENBLAS_NUM_THREADS=1 PYTHONPATH=tests $(BIN)/python -m tests.proofs.bench loaded --seconds $(or $(DURATION),600) --load $(LOAD) --devices $(or $(DEVICES),1) --write docs/measured.md

soak-faults: $(READY)
	$(BIN)/python -m tests.proofs.months run --minutes $(or $(MINUTES),20) $(if $(SEED),--seed $(SEED)) --write docs/reference/months.md

armour: $(READY)  ## attacks on the HTTP front (DURATION=… seconds each): quiet, beside busy loops, with few descriptors
	OPENBLAS_NUM_THREADS=1 PYTHONPATH=tests $(BIN)/python -m tests.proofs.bench armour --seconds $(or $(DURATION),10) --write docs/measured.md

hostile: $(READY)  ## captures that are made to be heavy, and many who ask for them (DURATION=… seconds), into docs/measured.md
	OPENBLAS_NUM_THREADS=1 PYTHONPATH=tests $(BIN)/python -m tests.proofs.bench hostile --seconds $(or $(DURATION),20) --write docs/measured.md

faults: $(READY)  ## every fault of grabber, disk, clock and clients, done to the whole daemon, into docs/reference/faults.md
	$(BIN)/python -m tests.proofs.faults --write docs/reference/faults.md

fuzz: $(READY)  ## hostile files, requests and arrays against everything that reads them (FUZZ_MINUTES=10, SEED=…, ONLY='png requests')
	$(ONE_THREAD) PYTHONPATH=tests:tests/support $(BIN)/python -m proofs.fuzz --minutes $(or $(FUZZ_MINUTES),10) $(if $(SEED),--seed $(SEED)) $(if $(ONLY),--only $(ONLY))

setups: $(READY)  ## every wrong set-up of a calibration, and what the user is told, into docs/reference/wrong-setups.md
	$(ONE_THREAD) PYTHONPATH=tests $(BIN)/python -m proofs.setups --write docs/reference/wrong-setups.md

footage: $(READY) ffmpeg  ## recordings in every container with every fault, and what comes of them, into docs/reference/footage.md
	$(ONE_THREAD) PYTHONPATH=tests $(BIN)/python -m proofs.footage --write docs/reference/footage.md

world: $(READY)  ## the whole daemon in simulated time and in every pair of faults: a thousand worlds (SEEDS=…, SEEDS=7:8 one again), into docs/reference/worlds.md; MUTANTS=120: those that worlds notice
	$(ONE_THREAD) PYTHONPATH=.:tests $(BIN)/python -m tests.proofs.$(if $(MUTANTS),world.mutants --count $(MUTANTS),world --seeds $(or $(SEEDS),1000) $(if $(findstring :,$(SEEDS)),,--write docs/reference/worlds.md))

audit: $(READY)  ## the account of fields in ten thousand (or SEEDS=…) runs and a daemon, both with everything going wrong, into docs/reference/audit.md
	$(ONE_THREAD) PYTHONPATH=tests:tests/support $(BIN)/python -m tests.proofs.audit --seeds $(or $(SEEDS),10000) --real-time --write docs/reference/audit.md

walls: $(READY)  ## the simulated liner's walls, solved anew (about an hour on two processors; NAMES='thin-round …')
	$(ONE_THREAD) nice $(BIN)/python -m tools.liner_wall drivers/grabberd_fake/walls $(NAMES)

house: $(READY)  ## the drawing of the rooms into docs/architecture.md; sizes and hops into docs/reference/house.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.house --write

docs: $(READY)  ## the generated parts of docs/: API, configuration, pictures; and the page's types
	$(BIN)/python docs/reference/generate.py
	$(BIN)/python docs/images/draw.py
	@$(MAKE) --no-print-directory types

format: $(READY)  ## lay out the code
	$(BIN)/ruff format src drivers systemd tests docs tools
	$(BIN)/ruff check --fix src drivers systemd tests docs tools

lock: $(READY)  ## write down the versions that the tests passed with
	$(BIN)/pip freeze --exclude-editable | LC_ALL=C sort > constraints.txt

clean:  ## remove what make made, but no captures
	rm -rf $(VENV) $(PEERS) node_modules build dist .mypy_cache .ruff_cache .pytest_cache

INSTALLED_FROM := pyproject.toml constraints.txt hatch_build.py $(wildcard src/grabberd/core/kernel/*.[ch])

# What running needs; the tests need more than twice as much.
$(RUNS): $(INSTALLED_FROM) | $(VENV)/made
	@bash tools/set_up.sh $(BIN)/python $(VENV)/set-up.log
	@touch $@

$(READY): $(INSTALLED_FROM) | $(VENV)/made
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[test]'
	@touch $(RUNS) $@

$(VENV)/made:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is missing: sudo apt-get install python3 python3-venv"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "$(PYTHON) is older than 3.11: sudo apt-get install python3.11"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { echo "the venv module is missing: sudo apt-get install python3-venv"; exit 1; }
	@echo "Making $(VENV), the program's own folder of Python packages; nothing outside of this folder changes."
	@$(PYTHON) -m venv $(VENV)
	@touch $@

$(PEERS)/ready: tests/proofs/bench/peers/peers.txt
	$(PYTHON) -m venv $(PEERS)
	$(PEERS)/bin/python -m pip install --quiet --requirement tests/proofs/bench/peers/peers.txt
	touch $@

$(NODE): package.json package-lock.json .npmrc
	npm ci --ignore-scripts
	@touch $@

node_modules/page-checked: $(NODE) tsconfig.json docs/reference/openapi.json $(PAGE_SOURCES)
	@npm run --silent types -- --check >/dev/null || { echo "$(PAGE_TYPES) is not what docs/reference/openapi.json gives: make types"; exit 1; }
	npm run --silent check
	@touch $@
