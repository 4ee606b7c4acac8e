# `make demo` and `make test` are all that a machine with only Rust needs.

SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup demo phone-demo test test-long python-test elsewhere-test viewer web check libraries deny

# Vulkan's loader and drivers expect a private runtime folder; containers and bare logins often have none.
with_runtime_dir = if [ -z "$${XDG_RUNTIME_DIR:-}" ]; then \
	XDG_RUNTIME_DIR=$$(mktemp -d); \
	trap 'rm -rf "$$XDG_RUNTIME_DIR"' EXIT; \
	chmod 700 "$$XDG_RUNTIME_DIR"; \
	export XDG_RUNTIME_DIR; \
	fi;

help: ## This list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-14s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## Install what is missing (Debian, Ubuntu)
	@bash scripts/setup.sh

demo: setup ## Train an avatar on a synthetic capture and print how good it is
	@$(with_runtime_dir) cargo run -p ghand-app --no-default-features --bin train -- --set iterations=660

phone-demo: setup ## Film a synthetic hand with one phone that turns around it, import the video, train on it
	@$(with_runtime_dir) \
	rm -rf out/phone-demo; \
	cargo build -p ghand-app --no-default-features --bin ghand --bin train; \
	bin="$${CARGO_TARGET_DIR:-target}/debug"; \
	"$$bin/ghand" capture --footage --moving --seconds 12 --out out/phone-demo/footage; \
	"$$bin/ghand" import out/phone-demo/footage --out out/phone-demo/capture; \
	"$$bin/train" --capture out/phone-demo/capture --out out/phone-demo/train

# Tests wait for programs and for the graphics device, so twice as many run at once as there are processors.
test: setup ## Run all tests
	@$(with_runtime_dir) \
	export GHAND_SKIPPED_TESTS="$$(realpath -m "$${CARGO_TARGET_DIR:-target}")/skipped-tests.txt"; \
	mkdir -p "$$(dirname "$$GHAND_SKIPPED_TESTS")"; \
	export RUST_TEST_THREADS="$${RUST_TEST_THREADS:-$$((2 * $$(getconf _NPROCESSORS_ONLN)))}"; \
	: >"$$GHAND_SKIPPED_TESTS"; \
	status=0; \
	cargo test --workspace --features networks || status=$$?; \
	bash scripts/skipped_tests.sh "$$GHAND_SKIPPED_TESTS"; \
	exit $$status

test-long: ## Run all tests, the long ones too, with many more cases
	@GHAND_LONG_TESTS=1 $(MAKE) test

python-test: setup ## Build the Python package and run its tests
	@$(with_runtime_dir) bash scripts/python_test.sh

elsewhere-test: setup ## Open the exports in three.js, PlayCanvas, Spark, Blender and others (see the script for what they need)
	@$(with_runtime_dir) bash scripts/elsewhere_test.sh

viewer: setup ## Open the viewer on AVATAR=FILE, else on the last trained avatar
	@$(with_runtime_dir) cargo run --bin viewer -- $(if $(AVATAR),"$(AVATAR)")

web: ## Build the player for web pages into web/dist (see the script for its tools)
	@bash scripts/build_web.sh

check: ## Formatting, lints, and the libraries' documentation
	@cargo fmt --all --check
	@cargo clippy --workspace --all-targets -- -D warnings
	@cargo clippy -p ghand-app -p ghand-lab --no-default-features --all-targets -- -D warnings
	@cargo clippy --workspace --all-targets --features gpu-networks -- -D warnings
	@RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --lib --features gpu-networks

libraries: ## Build the crates for browsers, and pack the splatter for other programs
	@bash scripts/check_wasm.sh
	@cargo package --quiet -p ghand-core -p ghand-render --allow-dirty

deny: ## Licences, advisories and duplicates of dependencies (needs cargo-deny)
	@cargo deny check
