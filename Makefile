# What a user types.  CMake does the work; this says what there is: see `make help`.
BUILD  ?= build
PREFIX ?= /usr/local
JOBS   ?= $(shell nproc 2>/dev/null || echo 1)

.PHONY: static test-readers tsan test-mpi fuzz test-fuzz all program deps configure test test-report test-crash demo demo-segmentations demo-joint viewer check sanitize bench install wheel package clean help

all: configure ## build build/apsm (the default)
	@cmake --build $(BUILD) -j$(JOBS)

configure:
	@scripts/setup --check || { echo "make: run 'make deps' to install what is missing" >&2; exit 1; }
	@test -f $(BUILD)/Makefile || cmake -S . -B $(BUILD) $(CMAKE_FLAGS)

deps: ## install what the build needs (says what before it does)
	@scripts/setup

test: deps ## deps, build, then all tests but those of the report in a browser
	@$(MAKE) --no-print-directory all
	@cd $(BUILD) && ctest -j2 --output-on-failure -E '^report\.(browser|bundle)$$'

test-report: deps ## the report in a browser (installs Chromium and Node.js, about 600 MB, if they are missing)
	@$(MAKE) --no-print-directory all
	@scripts/setup-browser $(BUILD)/browser
	@cd $(BUILD) && ctest --output-on-failure -R '^report\.(browser|bundle)$$'

test-readers: ## exports read by h5py, VTK, NumPy, Khronos' validator and three.js (installs what is missing, VTK's 1 GB too)
	@scripts/setup --readers
	@cmake -S . -B $(BUILD)-readers $(CMAKE_FLAGS)
	@cmake --build $(BUILD)-readers -j$(JOBS) --target apsm_cli make_synthetic
	@mkdir -p $(BUILD)-readers/packages && cp tests/readers/package*.json $(BUILD)-readers/packages
	@cd $(BUILD)-readers/packages && npm ci --silent --no-audit --no-fund --ignore-scripts
	@READERS=$(abspath $(BUILD)-readers/packages) bash tests/cli/test_export.sh $(abspath $(BUILD)-readers/apsm) $(abspath $(BUILD)-readers/make_synthetic)

test-crash: deps ## a thousand killed runs, each resumed and compared (about ten minutes)
	@$(MAKE) --no-print-directory all
	@cmake --build $(BUILD) --target test_crash
	@if command -v mpicc >/dev/null; then $(MAKE) --no-print-directory test-mpi KILLS=20; else \
	    echo "SKIPPED: killed ranks, there is no MPI here (scripts/setup --mpi)"; fi

test-mpi: ## build-mpi with MPI; 1, 2, 3 and 8 ranks, killed ones, job arrays: the same bytes
	@scripts/setup --mpi
	@cmake -S . -B $(BUILD)-mpi -DAPSM_MPI=ON $(CMAKE_FLAGS)
	@cmake --build $(BUILD)-mpi -j$(JOBS) --target apsm_cli make_synthetic
	@KILLS=$(KILLS) bash tests/cli/test_shards.sh $(BUILD)-mpi/apsm $(BUILD)-mpi/make_synthetic

program: configure ## build/apsm alone, without the tests
	@cmake --build $(BUILD) -j$(JOBS) --target apsm_cli

demo: deps ## a model of the 27 tali in data/talus
	@$(MAKE) --no-print-directory program
	$(BUILD)/apsm run data/talus -o $(BUILD)/demo-talus --reflect-match '_L_' --overwrite
	@echo "The report: $(CURDIR)/$(BUILD)/demo-talus/report.html"

demo-segmentations: deps ## a model of the 40 hippocampus masks in data/hippocampus
	@$(MAKE) --no-print-directory program
	$(BUILD)/apsm run data/hippocampus -o $(BUILD)/demo-hippocampus --label 1,2 --overwrite
	@echo "The report: $(CURDIR)/$(BUILD)/demo-hippocampus/report.html"

demo-joint: deps ## one model of tibia, fibula and talus of 27 ankles, in data/ankle and data/talus
	@$(MAKE) --no-print-directory program
	$(BUILD)/apsm run data/ankle data/talus -o $(BUILD)/demo-joint --reflect-match '_L_' --overwrite \
	    --parts tibia=_tibia,fibula=_fibula,talus=_talus
	@echo "The report: $(CURDIR)/$(BUILD)/demo-joint/report.html"

viewer: ## rebuild the page of `apsm report` from report/viewer (needs npm)
	cd report/viewer && npm ci --no-audit --no-fund && npm run --silent build

check: ## format, lint, rules between rooms, goldens, options.md, the viewer
	@scripts/check-format
	@scripts/check-lint
	@scripts/check-rooms
	@scripts/check-circles
	@scripts/check-functions
	@scripts/check-references
	@scripts/check-constants
	@scripts/check-golden
	@scripts/make-options-doc --check
	@scripts/check-viewer

sanitize: deps ## all tests with address and undefined-behaviour sanitizers
	@cmake -S . -B $(BUILD)-sanitize -DAPSM_SANITIZE=ON $(CMAKE_FLAGS)
	@cmake --build $(BUILD)-sanitize -j$(JOBS)
	@cd $(BUILD)-sanitize && ctest -j2 --output-on-failure

tsan: ## a short job with 4 threads under the thread sanitizer (clang and libomp-dev, whose archer knows what OpenMP does)
	@command -v clang >/dev/null || { echo "make: needs clang and libomp-dev" >&2; exit 1; }
	@cmake -S . -B $(BUILD)-tsan -DAPSM_TSAN=ON -DCMAKE_C_COMPILER=clang -DAPSM_TESTS=ON $(CMAKE_FLAGS)
	@cmake --build $(BUILD)-tsan -j$(JOBS) --target apsm_cli make_synthetic
	@bash scripts/tsan $(BUILD)-tsan

fuzz: deps ## readers on bytes that libFuzzer makes up, for a minute (needs clang)
	@scripts/fuzz

test-fuzz: deps ## all readers on 20,000 damaged files, with sanitizers
	@cmake -S . -B $(BUILD)-sanitize -DAPSM_SANITIZE=ON $(CMAKE_FLAGS)
	@cmake --build $(BUILD)-sanitize -j$(JOBS) --target test_damaged test_damaged_files
	$(BUILD)-sanitize/test_damaged 700
	$(BUILD)-sanitize/test_damaged_files 700

bench: deps ## the short set of benchmarks, and CPU by step beside an earlier commit's; a line of JSON each
	@cmake -S . -B $(BUILD) -DAPSM_BENCHMARKS=ON $(CMAKE_FLAGS)
	@cmake --build $(BUILD) -j$(JOBS)
	@benchmarks/short $(BUILD)
	@benchmarks/before $(BUILD) $(BUILD)/before

static: ## build-static/apsm: one program that needs no library, tried in a folder that holds nothing else
	@scripts/setup --check || { echo "make: run 'make deps' to install what is missing" >&2; exit 1; }
	@cmake -S . -B $(BUILD)-static -DAPSM_STATIC=ON -DAPSM_TESTS=OFF $(CMAKE_FLAGS)
	@cmake --build $(BUILD)-static -j$(JOBS) --target apsm_cli
	@scripts/check-static $(BUILD)-static/apsm data/talus

install: all ## to PREFIX (/usr/local), below DESTDIR if that is set
	cmake --install $(BUILD) --prefix $(PREFIX)

wheel: all ## build/wheel/apsm-*.whl: the Python module with the library and all it needs (needs python3-dev)
	@python3 scripts/make-wheel $(BUILD)
	@scripts/check-wheel $(BUILD)

package: configure ## build-package/*.deb: apsm, libapsm0, libapsm-dev
	@scripts/setup --package --check || { echo "make: run 'scripts/setup --package' to install what is missing" >&2; exit 1; }
	@cmake -S . -B $(BUILD)-package -DAPSM_PACKAGE=ON -DAPSM_TESTS=OFF -DCMAKE_SKIP_INSTALL_RPATH=ON \
	    -DCMAKE_INSTALL_PREFIX=/usr -DCMAKE_INSTALL_LIBDIR=lib/$$(dpkg-architecture -qDEB_HOST_MULTIARCH) \
	    -DCMAKE_SHARED_LINKER_FLAGS="$$(dpkg-buildflags --get LDFLAGS) -Wl,-z,now" \
	    -DCMAKE_EXE_LINKER_FLAGS="$$(dpkg-buildflags --get LDFLAGS) -Wl,-z,now -pie" \
	    -DCMAKE_C_FLAGS="-fstack-protector-strong -Wformat -Werror=format-security -D_FORTIFY_SOURCE=2 -ffile-prefix-map=$(CURDIR)=." $(CMAKE_FLAGS)
	@cmake --build $(BUILD)-package -j$(JOBS)
	@cd $(BUILD)-package && umask 022 && cpack -G DEB
	@# CPack calls ldconfig in scripts; the trigger in the package does what is needed.  OpenBLAS comes first, so that apt
	@# does not take the reference BLAS for LAPACKE's sake.
	@cd $(BUILD)-package && rm -rf repack && for deb in apsm_*.deb libapsm0_*.deb; do dpkg-deb -R $$deb repack && \
	    rm -f repack/DEBIAN/postinst repack/DEBIAN/postrm && \
	    sed -i '/^Depends: .*libopenblas0,/{s/ libopenblas0,//;s/^Depends:/Depends: libopenblas0,/}' repack/DEBIAN/control && \
	    dpkg-deb --root-owner-group -b repack $$deb >/dev/null && rm -rf repack; done
	@ls $(BUILD)-package/*.deb

clean: ## remove everything that was built
	rm -rf $(BUILD) $(BUILD)-sanitize $(BUILD)-mpi $(BUILD)-package $(BUILD)-readers $(BUILD)-static

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## /  make \1: /p' Makefile
