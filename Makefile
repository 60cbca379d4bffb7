# cloudvdb's chores. Every target is safe to repeat; the second run installs, downloads and builds nothing again.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help
# rustup's cargo, also where the shell's profile has not been read.
export PATH := $(or $(CARGO_HOME),$(HOME)/.cargo)/bin:$(PATH)

BUILD_PACKAGES := g++ make pkg-config ca-certificates libopenvdb-dev libboost-dev libimath-dev libtbb-dev
# Open MPI, and what makes Rust's bindings to it.
MPI_PACKAGES := libopenmpi-dev openmpi-bin libclang-dev
# OpenVDB's own Python module is the tests' independent reader; the libraries are those that Blender as a module loads.
TEST_PACKAGES := python3 python3-venv python3-numpy python3-openvdb \
	libxrender1 libxxf86vm1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libgl1 libegl1

# make test FEATURES=mpi builds and tests with Open MPI.
FEATURES ?=
with_features := $(if $(FEATURES),--features $(FEATURES))

VENV := .venv
PYTEST = $(VENV)/bin/python -m pytest tests/python

# $(call need,PACKAGES): installs what is missing, or says exactly what to type, and stops.
define need
if ! command -v dpkg-query >/dev/null; then
	echo "note: not a Debian; the equivalents of these packages are needed: $(strip $(1))" >&2
else
	missing=()
	for package in $(1); do
		status=$$(dpkg-query -W -f='$${db:Status-Status}' "$$package" 2>/dev/null || true)
		[[ $$status == installed* ]] || missing+=("$$package")
	done
	if (( $${#missing[@]} )); then
		root=(env)
		if (( EUID )); then
			if sudo -n true 2>/dev/null; then root=(sudo env); else
				echo "Missing packages. Install them, then repeat:  sudo apt-get install -y $${missing[*]}" >&2; exit 1
			fi
		fi
		"$${root[@]}" DEBIAN_FRONTEND=noninteractive apt-get update -qq </dev/null
		"$${root[@]}" DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$${missing[@]}" </dev/null
	fi
fi
endef
.ONESHELL:

.PHONY: help demo build mpi test test-mpi bench addon scenes crosscheck crosscheck-speed fuzz sanitize sanitize-core study lint clean build-packages mpi-packages test-packages rust

help: ## This list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## */  make \1\t/' | expand -t 26

demo: build ## A cumulus from the layout in scenes/, as out/cumulus.vdb and out/cumulus.json
	mkdir -p out
	target/release/cloudvdb scenes/cumulus.gltf -o out/cumulus.vdb -o out/cumulus.json --overwrite
	density=$$(sed -n 's/.*"density_scale": *\([0-9.eE-]*\).*/\1/p' out/cumulus.json)
	printf 'next: open out/cumulus.vdb in Blender (Add > Volume > Import OpenVDB); give it a Principled Volume with Density %.4g, Color white, Anisotropy 0.86 (README.md, "In Blender, by hand"; or the add-on: make addon)\n' "$$density"

build: build-packages rust ## The command, target/release/cloudvdb
	cargo build --release

mpi: build-packages mpi-packages rust ## The command for many machines, target/mpi/cloudvdb (mpirun -n 4 target/mpi/cloudvdb ...)
	cargo build --release --features mpi
	# The ordinary build puts its own command back in its place.
	mkdir -p target/mpi
	cp target/release/cloudvdb target/mpi/cloudvdb

# Cargo builds the command for its tests: with a `build` before, other features of the same libraries would build all twice.
test: build-packages test-packages rust $(VENV)/.stamp ## All tests: Rust's, then those that use Blender and OpenVDB from Python
	cargo test --release $(with_features)
	$(if $(findstring mpi,$(FEATURES)),CLOUDVDB_MPI=target/release/cloudvdb) $(PYTEST) -n 2 --dist loadfile

test-mpi: mpi test-packages $(VENV)/.stamp ## The same bytes on 1 to 4 ranks; ranks that die; checkpoints
	CLOUDVDB=target/mpi/cloudvdb CLOUDVDB_MPI=target/mpi/cloudvdb $(PYTEST)/test_mpi.py -m 'not long'

bench: build ## Criterion's benchmarks
	cargo bench

addon: build test-packages $(VENV)/.stamp ## The Blender add-on's zips in out/, the command inside; the extension validated
	$(VENV)/bin/python -I blender_addon/build.py --output out --binary target/release/cloudvdb

scenes: test-packages $(VENV)/.stamp ## Writes the scenes again, with Blender
	$(VENV)/bin/python -I scenes/make_scenes.py

crosscheck: build test-packages $(VENV)/.crosscheck ## The longer comparisons, with Cycles, Mitsuba and published figures
	cargo test --release --lib --test light --test stability -- --ignored --nocapture
	$(PYTEST) -m long

crosscheck-speed: build test-packages $(VENV)/.crosscheck ## Samples a second and noise, beside Cycles and Mitsuba; the grid integrator; baked light
	$(VENV)/bin/python tests/python/speed.py
	$(VENV)/bin/python tests/python/grid_error.py
	$(VENV)/bin/python tests/python/denoised.py
	$(VENV)/bin/python tests/python/bake_error.py

study: build test-packages $(VENV)/.stamp ## What accuracy costs in the cumulus, beside Cycles and Mitsuba where they are installed: out/study/index.html
	$(VENV)/bin/python tests/python/study_peers.py out/study

# The sanitizer's flags for Rust and for the bridge: gcc's coverage is none that libFuzzer understands, so C++ is compiled by clang.
FUZZ_FLAGS := -Zsanitizer=address --cfg fuzzing -Ccodegen-units=4 -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
	-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares
FUZZ_BUILD = CARGO_TARGET_DIR=target/fuzz CXX=clang++-14 CUSTOM_LIBFUZZER_STD_CXX=stdc++ \
	CUSTOM_LIBFUZZER_PATH=$$(clang-14 -print-file-name=libclang_rt.fuzzer-x86_64.a) RUSTFLAGS="$(FUZZ_FLAGS)" \
	CXXFLAGS="-fsanitize=address -fsanitize-coverage=inline-8bit-counters,pc-table,trace-cmp" \
	cargo +nightly build --release --manifest-path tests/fuzz/Cargo.toml --target x86_64-unknown-linux-gnu
FUZZ_TARGETS := gltf extras vdb command
LEAKS := LSAN_OPTIONS=suppressions=$(CURDIR)/tests/fuzz/leaks.txt
TARGET ?= $(FUZZ_TARGETS)
SECONDS_EACH ?= 60

fuzz: build-packages ## Coverage-guided fuzzing of all readers, a minute each (a nightly Rust; TARGET=vdb SECONDS_EACH=3600)
	@$(call need,clang-14 libclang-rt-14-dev)
	$(FUZZ_BUILD)
	for target in $(TARGET); do
		mkdir -p target/fuzz/found/$$target
		(cd target/fuzz && $(LEAKS) x86_64-unknown-linux-gnu/release/$$target -max_total_time=$(SECONDS_EACH) -timeout=25 -rss_limit_mb=4096 -print_final_stats=1 \
			-artifact_prefix=found/$$target- found/$$target ../../tests/fuzz/corpus/$$target)
	done

sanitize: build-packages ## The fuzzers' corpus under the address sanitizer, Rust and C++ (a nightly Rust)
	@$(call need,clang-14 libclang-rt-14-dev)
	$(FUZZ_BUILD)
	for target in $(FUZZ_TARGETS); do
		$(LEAKS) target/fuzz/x86_64-unknown-linux-gnu/release/$$target -runs=0 -timeout=60 tests/fuzz/corpus/$$target
	done

# The core under a sanitizer, KIND=address or thread, with Rust's own library compiled for it too; OpenVDB is Debian's, as it is.
KIND ?= address thread
NOT_CORE := rates:: image:: noise:: statistics:: sees_what sees_colours harmonics furnace overlaps_ground
sanitize-core: build-packages ## The library's tests under the address and the thread sanitizer, Rust and C++ (a nightly Rust with rust-src)
	@$(call need,clang-14 libclang-rt-14-dev)
	for kind in $(KIND); do
		$(LEAKS) TSAN_OPTIONS=suppressions=$(CURDIR)/tests/fuzz/races.txt CARGO_TARGET_DIR=target/$$kind CXX=clang++-14 \
			CXXFLAGS=-fsanitize=$$kind RUSTFLAGS=-Zsanitizer=$$kind cargo +nightly test -Zbuild-std \
			--target x86_64-unknown-linux-gnu --release --lib -- $(addprefix --skip ,$(NOT_CORE))
	done

lint: build-packages rust ## Formatting and clippy
	cargo fmt --check
	cargo clippy --release --all-targets -- -D warnings

clean: ## Removes what was built and written (not .venv)
	rm -rf target out

rust:
	@command -v cargo >/dev/null || { echo "Rust is missing. Install it from https://rustup.rs, then repeat." >&2; exit 1; }

build-packages:
	@$(call need,$(BUILD_PACKAGES))

mpi-packages:
	@$(call need,$(MPI_PACKAGES))

test-packages:
	@$(call need,$(TEST_PACKAGES))

# Blender as a module (bpy 4.5) asks for Python 3.11 exactly: Debian 12's own.
$(VENV)/.stamp: tests/requirements.txt | test-packages
	@echo 'Python environment for the tests: $(VENV)'
	python=
	for candidate in /usr/bin/python3 python3.11; do
		if "$$candidate" -c 'import sys, venv; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null; then python=$$candidate; break; fi
	done
	[[ $$python ]] || { echo "Python 3.11 is missing (bpy 4.5 asks for it). Put python3.11 on the PATH, then repeat." >&2; exit 1; }
	"$$python" -m venv --clear $(VENV)
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check -r tests/requirements.txt
	touch $@

# Peers that only the long comparisons need.
$(VENV)/.crosscheck: tests/requirements-crosscheck.txt $(VENV)/.stamp
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check -r tests/requirements-crosscheck.txt
	touch $@
