# Lathe. `make help` lists the targets.
#
#   config=release (default) | debug | sanitize | fuzz      objects go to build/$(config)/
#   CC, CXX, CFLAGS, LDFLAGS, CLANG, V=1                     as everywhere

config ?= release
B := build/$(config)
V ?= 0
Q := $(if $(filter 0,$(V)),@)
ifeq ($(origin CC),default)
CC := gcc
endif
ifeq ($(origin CXX),default)
CXX := g++
endif
CLANG ?= clang
CLANGXX ?= clang++
WASM_LD ?= wasm-ld
WASM_OPT ?= $(shell command -v wasm-opt)
PARALLEL = $(if $(filter -j% --jobserver%,$(MAKEFLAGS)),,-j$(shell nproc 2>/dev/null || echo 2))

# ---- sources: found by wildcard, but for the decoder that becomes wasm -------------------------------------------------

CORE := $(wildcard core/*.c core/sections/*.c)
CODEC := $(filter-out codec/wasm_exports.c,$(wildcard codec/*.c))
CODEC_CXX := $(wildcard codec/*.cc)
SERVER := $(filter-out server/main.c,$(wildcard server/*.c))
UNIT_TESTS := $(basename $(notdir $(wildcard tests/test_*.c)))
CHECKS := $(basename $(notdir $(wildcard tests/*_check.cpp)))
FUZZERS := $(basename $(notdir $(wildcard tests/fuzz_*.c)))

# The decoder. Linking it proves that it needs no volume, no ray casting on grey values and no file.
WASM_SOURCES := $(addprefix core/,status.c arena.c ray.c crossing.c contour.c grammar.c tiling.c centre.c grid.c outline.c triangulate.c \
                  overlay.c tube.c builder.c cube_table.c raster_surface.c level.c refinement.c mask.c mesh.c) \
                $(addprefix codec/,range_decoder.c occupancy_model.c model_state.c occupancy_decode.c base_shape.c base_decode.c radius_map.c radius_mesh.c \
                  radius_tubes.c radius_stack.c radius_joint.c radius_group.c structure_state.c structure_decode.c pyramid.c pyramid_decode.c archive_parse.c crc32c.c decode.c) \
                $(wildcard web/wasm/*.c)

# ---- flags -------------------------------------------------------------------------------------------------------------

ifeq ($(config),release)
  OPTIMISE := -O2 -DNDEBUG
else ifeq ($(config),debug)
  OPTIMISE := -O0 -g
else ifeq ($(config),sanitize)
  OPTIMISE := -O1 -g -fno-omit-frame-pointer -fsanitize=address,undefined -fno-sanitize-recover=undefined
  LINK_MODE := -fsanitize=address,undefined
else ifeq ($(config),fuzz)
  CC := $(CLANG)
  CXX := $(CLANGXX)
  OPTIMISE := -O1 -g -fno-omit-frame-pointer -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=undefined
  LINK_MODE := -fsanitize=address,undefined
else
  $(error config=$(config): it is one of release, debug, sanitize, fuzz)
endif

WARNINGS := -Wall -Wextra -Werror
# No contraction of a*b+c: every platform computes the same positions.
COMMON = $(OPTIMISE) $(WARNINGS) -ffp-contract=off -D_GNU_SOURCE -Icore -Icore/sections -Icodec -Iserver -Itests -I/usr/include/nifti -MMD -MP
ALL_CFLAGS = -std=c11 $(COMMON) $(CFLAGS)
ALL_CXXFLAGS = -std=c++17 $(COMMON) $(CXXFLAGS)
LIBS := -Wl,--as-needed -lmicrohttpd -ljansson -ldraco -lnifti2 -lznz -lz -lbrotlienc -lpthread -lm

WASM := build/wasm/lathe.wasm
RASTERS := build/wasm/rasters.wasm
TUBES := build/wasm/tubes.wasm
VIEWER := web/dist/viewer.html
DRACO_PAGE := web/dist/draco.html
# What is linked into the program: lathe_NAME and the file in web/dist.
EMBEDDED := viewer_html:viewer.html extras_js:extras.js decoder_text:decoder.txt rasters_text:rasters.txt tubes_text:tubes.txt draco_html:draco.html

# ---- the program -------------------------------------------------------------------------------------------------------

.PHONY: all
all: build/lathe ## build the program (the default): build/lathe

build/lathe: $(B)/lathe FORCE
	@cmp -s $< $@ || install -m 755 $< $@

LIBRARY := $(B)/liblathe.a
SERVER_LIBRARY := $(B)/liblathe_server.a
LIBRARY_OBJECTS := $(patsubst %.c,$(B)/%.o,$(CORE) $(CODEC)) $(patsubst %.cc,$(B)/%.o,$(CODEC_CXX))
SERVER_OBJECTS := $(patsubst %.c,$(B)/%.o,$(SERVER))

$(LIBRARY): $(LIBRARY_OBJECTS)
	$(Q)rm -f $@ && $(AR) rcs $@ $^
$(SERVER_LIBRARY): $(SERVER_OBJECTS)
	$(Q)rm -f $@ && $(AR) rcs $@ $^

$(B)/lathe: $(B)/server/main.o $(foreach pair,$(EMBEDDED),$(B)/server/embedded_$(firstword $(subst :, ,$(pair))).o) $(SERVER_LIBRARY) $(LIBRARY)
	@echo "  link  $@"
	$(Q)$(CXX) $(LINK_MODE) $(LDFLAGS) -o $@ $^ $(LIBS)

$(B)/%.o: %.c
	@mkdir -p $(@D)
	@echo "  cc    $<"
	$(Q)$(CC) $(ALL_CFLAGS) -c -o $@ $<
$(B)/%.o: %.cc
	@mkdir -p $(@D)
	@echo "  c++   $<"
	$(Q)$(CXX) $(ALL_CXXFLAGS) -c -o $@ $<
$(B)/%.o: %.cpp
	@mkdir -p $(@D)
	@echo "  c++   $<"
	$(Q)$(CXX) $(ALL_CXXFLAGS) -c -o $@ $<

# The pages, the scripts and the decoders are linked into the program as they are.
define embed
$(B)/server/embedded_$(1).o: server/embedded.S web/dist/$(2)
	@mkdir -p $$(@D)
	$$(Q)$$(CC) -DNAME=lathe_$(1) -DFILE='"web/dist/$(2)"' -c -o $$@ $$<
endef
$(foreach pair,$(EMBEDDED),$(eval $(call embed,$(firstword $(subst :, ,$(pair))),$(lastword $(subst :, ,$(pair))))))

# ---- the viewer and its decoder ----------------------------------------------------------------------------------------

# As web/wasm/README.md says: no imports, our own small C library, a stack that traps when it overflows. Optimising at link time
# makes the compressed module 3 % smaller.
# Some of what LLVM does for speed costs size even with -Oz: loop strength reduction 0.6 kB of the compressed module, PRE 0.1 kB.
WASM_OPTIMISE := -Oz -mllvm -enable-pre=0
WASM_FLAGS = --target=wasm32 -std=c11 $(WASM_OPTIMISE) -flto -mbulk-memory -mnontrapping-fptoint -msign-ext -fvisibility=hidden -ffreestanding \
              -fno-builtin -nostdlib -DLATHE_SMALL -ffp-contract=off -ffunction-sections -fdata-sections -DNDEBUG -Wall -Wextra -Werror \
              -isystem web/wasm/include -Icore -Icodec -Iweb/wasm -MMD -MP
WASM_LINK := --no-entry --gc-sections --strip-all --stack-first -z stack-size=262144 -O2 --lto-O1 --compress-relocations -mllvm -disable-lsr
# Binaryen, where it is installed: 3 to 5 % smaller under brotli, as fast. Low memory is the far end of the stack (--stack-first).
WASM_OPTIMISER = $(WASM_OPT) --enable-bulk-memory --enable-sign-ext --enable-nontrapping-float-to-int --low-memory-unused --flatten --rereloop -Oz
WASM_BUILTINS = $(firstword $(shell find -L $$($(CLANG) -print-resource-dir)/lib -name 'libclang_rt.builtins*wasm32*.a' 2>/dev/null))

.PHONY: wasm web
wasm: $(WASM) $(RASTERS) $(TUBES) ## the decoder as wasm: build/wasm/lathe.wasm; of rasters or tubes alone: rasters.wasm, tubes.wasm beside it
web: $(VIEWER) $(DRACO_PAGE) ## the viewer page: web/dist/viewer.html; the page of the Draco deltas

HOT := $(addsuffix %,$(addprefix codec/,occupancy_ range_ pyramid radius_ base_decode structure_decode) $(addprefix core/,raster_surface triangulate grid overlay outline centre crossing))
# Where the time goes: 1.6 kB more, a fifth faster.
$(foreach dir,build/wasm build/wasm/rasters,$(patsubst %.c,$(dir)/%.o,$(filter $(HOT),$(WASM_SOURCES)))): WASM_OPTIMISE := -O2 -fno-unroll-loops
# Of tubes: 0.2 kB for a tenth.
$(patsubst %,build/wasm/tubes/codec/%.o,range_decoder radius_map radius_mesh radius_stack radius_joint): WASM_OPTIMISE := -O2 -fno-unroll-loops
# Not in the decoder of rasters, which is loaded first: unrolled, a tenth faster still.
$(patsubst %.c,build/wasm/%.o,$(filter codec/radius_% core/triangulate%,$(WASM_SOURCES))): WASM_OPTIMISE := -O3

build/wasm/%.o: %.c
	@mkdir -p $(@D)
	@echo "  wasm  $<"
	$(Q)$(CLANG) $(WASM_FLAGS) -c -o $@ $<
# The same sources: what a decoder of rasters or of tubes never does is dropped by the linker.
build/wasm/rasters/%.o: %.c
	@mkdir -p $(@D)
	@echo "  wasm  $< (rasters)"
	$(Q)$(CLANG) $(WASM_FLAGS) -DLATHE_RASTERS -c -o $@ $<
build/wasm/tubes/%.o: %.c
	@mkdir -p $(@D)
	@echo "  wasm  $< (tubes)"
	$(Q)$(CLANG) $(WASM_FLAGS) -DLATHE_TUBES -c -o $@ $<
$(WASM): $(WASM_SOURCES:%.c=build/wasm/%.o)
$(RASTERS): $(WASM_SOURCES:%.c=build/wasm/rasters/%.o)
$(TUBES): $(WASM_SOURCES:%.c=build/wasm/tubes/%.o)
$(WASM) $(RASTERS) $(TUBES):
	@echo "  link  $@"
	$(Q)$(WASM_LD) $(WASM_LINK) -o $@ $^ $(WASM_BUILTINS)
	$(Q)$(if $(WASM_OPT),$(WASM_OPTIMISER) -o $@ $@,echo "  (no wasm-opt: $@ stays 5 % larger)")

web/node_modules/.package-lock.json: web/package-lock.json
	@echo "  npm   web"
	$(Q)cd web && npm ci --no-audit --no-fund --loglevel=error && touch node_modules/.package-lock.json
$(VIEWER): $(WASM) $(RASTERS) $(TUBES) web/node_modules/.package-lock.json web/build.mjs $(wildcard web/src/* web/*.json)
	@echo "  web   $@"
	$(Q)cd web && node build.mjs ../$(WASM) ../$(RASTERS) ../$(TUBES) ../$(VIEWER)
# Written with the page.
$(addprefix web/dist/,extras.js decoder.txt rasters.txt tubes.txt): $(VIEWER)
	@:                                      # without a recipe make would not see that they are new
$(DRACO_PAGE): web/node_modules/.package-lock.json web/build_draco.mjs $(wildcard web/src/draco*)
	@echo "  web   $@"
	$(Q)cd web && node build_draco.mjs ../$(DRACO_PAGE)

# ---- demo --------------------------------------------------------------------------------------------------------------

PORT ?= 8080
BIND ?= 127.0.0.1

.PHONY: demo
demo: ## install what is missing, bake a brain and an atlas, serve them on http://127.0.0.1:8080/
	@tests/scripts/setup.sh demo
	@$(MAKE) --no-print-directory $(PARALLEL) all config=release
	@BIND=$(BIND) PORT=$(PORT) tests/scripts/demo.sh

# ---- tests -------------------------------------------------------------------------------------------------------------

.PHONY: test test-programs sanitize sanitize-programs fuzz fuzzers bench bench-bytes soak
test: ## install what is missing, build, run every test; ends with "N passed, N failed"
	@tests/scripts/setup.sh test
	@tests/scripts/run_tests.sh

test-programs: all $(UNIT_TESTS:%=$(B)/tests/%) $(CHECKS:%=$(B)/tests/%) $(B)/tests/make_phantom
sanitize-programs: $(UNIT_TESTS:%=$(B)/tests/%) $(B)/tests/make_phantom $(B)/lathe

sanitize: ## the C tests under AddressSanitizer and UBSan
	@tests/scripts/run_tests.sh sanitize

fuzz: ## every fuzz target for SECONDS_EACH=10 (see docs/CONTRIBUTING.md)
	@tests/scripts/run_tests.sh fuzz
fuzzers: $(FUZZERS:%=$(B)/tests/%)

bench: ## measure the figures of the README (needs python3-vtk9); prints the table
	@tests/scripts/setup.sh bench
	@$(MAKE) --no-print-directory $(PARALLEL) all config=release
	@tests/bench/bench.py

PEERS := $(addprefix $(B)/tests/bench/peers/,peer_codecs lindstrom_turk mask_model)
bench-bytes: ## measure bytes over error against other coders: docs/BYTES.md, docs/img/bytes_*.svg (QUICK=1: roughly)
	@tests/scripts/setup.sh bench
	@$(MAKE) --no-print-directory $(PARALLEL) all bench-peers config=release
	@tests/bench/bytes.py $(if $(QUICK),--quick,--markdown docs/BYTES.md --plots docs/img --json build/bytes.json)
.PHONY: bench-peers
bench-peers: $(PEERS)
# CGAL's headers do not compile without warnings.
$(B)/tests/bench/peers/lindstrom_turk.o: WARNINGS :=
$(B)/tests/bench/peers/lindstrom_turk $(B)/tests/bench/peers/peer_codecs: %: %.o
	$(Q)$(CXX) $(LINK_MODE) $(LDFLAGS) -o $@ $^ -Wl,--as-needed -ldraco -lmeshoptimizer -lzstd -lgmp -lmpfr
$(B)/tests/bench/peers/mask_model: %: %.o
	$(Q)$(CC) $(LINK_MODE) $(LDFLAGS) -o $@ $^ -lm

# Programs that print one table of the papers each.
TABLES := $(basename $(notdir $(wildcard tests/bench/*.c)))
.PHONY: tables
tables: $(TABLES:%=$(B)/tests/bench/%) ## measure the papers' tables again: docs/TABLES.md
	@tests/bench/tables.sh $(B)/tests/bench docs/TABLES.md
$(TABLES:%=$(B)/tests/bench/%): $(B)/tests/bench/%: $(B)/tests/bench/%.o $(LIBRARY)
	@echo "  link  $@"
	$(Q)$(CXX) $(LINK_MODE) $(LDFLAGS) -o $@ $^ $(LIBS)

PAIRS ?= 1000000
soak: $(B)/tests/soak ## random pairs of slices, PAIRS=1000000 of them: every guarantee, exact and coarse
	@$< $(PAIRS)

TEST_HELPERS := $(patsubst %.c,$(B)/%.o,$(wildcard tests/phantom.c))
$(UNIT_TESTS:%=$(B)/tests/%) $(B)/tests/soak: $(B)/tests/%: $(B)/tests/%.o $(TEST_HELPERS) $(SERVER_LIBRARY) $(LIBRARY)
	@echo "  link  $@"
	$(Q)$(CXX) $(LINK_MODE) $(LDFLAGS) -o $@ $^ $(LIBS)
$(FUZZERS:%=$(B)/tests/%): $(B)/tests/%: $(B)/tests/%.o $(TEST_HELPERS) $(LIBRARY)
	@echo "  link  $@"
	$(Q)$(CXX) -fsanitize=fuzzer,address,undefined $(LDFLAGS) -o $@ $^ $(LIBS)
$(B)/tests/make_phantom: $(B)/tests/make_phantom.o
	$(Q)$(CC) $(LINK_MODE) $(LDFLAGS) -o $@ $^ -lm
# CGAL's headers do not compile without warnings.
$(CHECKS:%=$(B)/tests/%.o): WARNINGS :=
$(CHECKS:%=$(B)/tests/%): $(B)/tests/%: $(B)/tests/%.o
	$(Q)$(CXX) $(LINK_MODE) $(LDFLAGS) -o $@ $^ -Wl,--as-needed -ldraco -lgmp -lmpfr -lpthread

# ---- housekeeping ------------------------------------------------------------------------------------------------------

OURS := $(wildcard core/*.[ch] core/sections/*.[ch] codec/*.[ch] codec/*.cc server/*.[ch] tests/*.[ch] tests/*.cpp web/wasm/*.[ch])

.PHONY: deps format lint help clean FORCE
deps: ## install what building and testing need (Debian packages, npm packages)
	@tests/scripts/setup.sh test

format: ## clang-format every C and C++ file
	clang-format -i $(OURS)
lint: ## clang-tidy, and the sources compiled by clang with every warning we use
	clang-tidy --quiet $(CORE) $(CODEC) $(SERVER) server/main.c -- -std=c11 -D_GNU_SOURCE -Icore -Icore/sections -Icodec -Iserver -I/usr/include/nifti
	@for f in $(CORE) $(CODEC) $(SERVER) server/main.c; do \
	    $(CLANG) -std=c11 -Wall -Wextra -Werror -D_GNU_SOURCE -Icore -Icore/sections -Icodec -Iserver -I/usr/include/nifti -fsyntax-only $$f || exit 1; done

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))
	@echo "  config=release|debug|sanitize|fuzz chooses the build, objects go to build/<config>/"

clean: ## remove build/ and web/dist/
	rm -rf build web/dist

FORCE:
.SECONDARY:
.DELETE_ON_ERROR:
-include $(wildcard $(B)/*/*.d $(B)/*/*/*.d $(B)/*/*/*/*.d build/wasm/*/*.d build/wasm/*/*/*.d)
