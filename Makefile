# Thin calls: every target does what is missing and then its job. The work is in tools/ and in build/quadruped3d.
PRESET ?= release
BUILD  := build/$(PRESET)
OUT    ?= out
CONFIG ?=
JOBS   ?= $(shell nproc)
SCHEDULE ?= full
SEED     ?= 0
ALLOW_UPGRADES ?=
ACCEPT_LICENCES ?=
FUZZ_SECONDS ?= 60
FUZZ_TARGETS ?=
KILLS ?= 1000
FLIPS ?= 300
DAMAGES ?= 11000
CUTS ?= 100
PAUSE ?= 60
FAULTS ?= 25 --jobs labels

.PHONY: quadruped3d sample-model sample-loop test program build setup test-wheels assets format tidy nightly bench asan tsan fuzz torture clean help

quadruped3d: program  ## build the dataset that CONFIG describes (default: the rendered sample world)
	tools/quadruped3d.sh $(OUT) $(CONFIG)

sample-model: program  ## train the network that ships on rendered worlds (pre-training, Stage 1, two longer trainings)
	tools/sample_loop.sh model

sample-loop: program  ## Stage 1, Stage 2, Stage 3 and their tables (SCHEDULE=full or quick, SEED=0)
	tools/sample_loop.sh loop $(SCHEDULE) $(SEED)

test: test-wheels build  ## build everything and run all tests
	ctest --test-dir $(BUILD) --output-on-failure --parallel $(JOBS)

program: $(BUILD)/build.ninja  ## compile the program alone (release unless PRESET says otherwise)
	@cmake --build $(BUILD) --parallel $(JOBS) --target quadruped3d
	@ln -sfn $(PRESET)/bin/quadruped3d build/quadruped3d

build: $(BUILD)/build.ninja  ## compile everything, tests too
	@cmake --build $(BUILD) --parallel $(JOBS)
	@ln -sfn $(PRESET)/bin/quadruped3d build/quadruped3d

setup:  ## install Debian packages and LibTorch where they are missing (docs/install.md)
	@tools/setup.sh $(if $(ALLOW_UPGRADES),--allow-upgrades)

test-wheels: setup  ## install the Python wheels that only the tests need (docs/install.md)
	@tools/setup.sh --python-only --tests

assets: setup  ## fetch, verify and import the official weights and body (ACCEPT_LICENCES=1 accepts their terms)
	@.venv/bin/python tools/import_assets.py fetch $(if $(ACCEPT_LICENCES),--accept-licences)

$(BUILD)/build.ninja: | setup
	cmake --preset $(PRESET) $(CMAKE_ARGS)

bench: setup  ## build the benchmarks and run those of the network and the feed beside their baselines (bench/README.md)
	cmake --preset $(PRESET) -DQ3D_BENCH=ON
	cmake --build $(BUILD) --parallel $(JOBS) --target model_bench step_memory feed_bench leakage_bench
	.venv/bin/python bench/run.py $(BUILD)

asan:  ## all tests under the address and undefined-behaviour sanitizers
	$(MAKE) test PRESET=asan

fuzz: setup  ## fuzz every reader of files for FUZZ_SECONDS each (clang; tests/fuzz)
	@command -v clang++ >/dev/null || { echo "make fuzz needs clang: apt-get install clang" >&2; exit 2; }
	cmake --preset fuzz
	cmake --build build/fuzz --parallel $(JOBS) --target fuzz_targets
	tools/fuzz.sh build/fuzz $(FUZZ_SECONDS) $(FUZZ_TARGETS)

tsan: setup  ## tests of what threads share under the thread sanitizer, with a oneTBB that is compiled for it
	tools/sanitized_tbb.sh build/tsan-tbb
	cmake --preset tsan
	cmake --build build/tsan --parallel $(JOBS) --target tsan_tests
	TSAN_OPTIONS="second_deadlock_stack=1 suppressions=$(CURDIR)/tests/tsan.suppressions" \
	  ctest --test-dir build/tsan --output-on-failure --parallel $(JOBS) -R "$$(cat build/tsan/tsan_tests.txt)"

torture: build  ## kills, damaged files, failing calls, pauses, power cuts (docs/reliability.md); compares what is left
	.venv/bin/python tests/torture/torture.py $(KILLS)
	.venv/bin/python tests/torture/rot.py $(FLIPS)
	Q3D_DAMAGES=$(DAMAGES) $(BUILD)/tests/pipeline/build/rebuild_test --gtest_filter='Rot.*'
	Q3D_DAMAGES=$$(($(DAMAGES) / 10)) $(BUILD)/tests/pipeline/training/training_test --gtest_filter='TrainingRot.*'
	.venv/bin/python tests/torture/faults.py $(FAULTS)
	[ $(PAUSE) -eq 0 ] || .venv/bin/python tests/torture/pause.py $(PAUSE)
	[ $(CUTS) -eq 0 ] || .venv/bin/python tests/torture/power_cut.py $(CUTS)

nightly:  ## all that CI has no time for: clang-tidy on every source, tests under the sanitizers, fuzzing, torture
	$(MAKE) build
	BUILD=$(BUILD) JOBS=$(JOBS) tools/tidy.sh --all
	$(MAKE) asan
	$(MAKE) tsan
	$(MAKE) fuzz FUZZ_SECONDS=600
	$(MAKE) torture FAULTS=1

format:  ## format every source in place
	git ls-files '*.h' '*.cpp' | xargs clang-format -i

tidy: $(BUILD)/build.ninja  ## clang-tidy on the C++ files that differ from origin/main (tools/tidy.sh says what else it can)
	@BUILD=$(BUILD) JOBS=$(JOBS) tools/tidy.sh

clean:  ## remove what was compiled
	rm -rf build

help:  ## this list
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 16
