#!/usr/bin/env bash
# Mutation testing: changes the code in one place at a time and checks whether a test fails.
#
#   packaging/mutants.sh [AREA…]               physics effects plant control fmi2 campaign gap, or all of them
#   packaging/mutants.sh --changed [BASE]      only what differs from BASE (the parent commit unless said otherwise): what CI runs
#   MINUTES=10 packaging/mutants.sh …          ends after so many minutes; mutants come in random order, so what was tried is a sample
#
# Each area has the tests that cover it. Prints the score of each and writes target/mutants/<area>/mutants.out. Exits with 2 if a surviving mutant is not in
# packaging/mutants.txt, the list of known ones with their reasons. Uses cargo-mutants, which it installs below target/tools.
set -euo pipefail
cd "$(dirname "$0")/.."

version=25.3.1
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
tools=$target/tools
export PATH=$tools/bin:$PATH CARGO_PROFILE_DEV_DEBUG=0 RUST_BACKTRACE=0
if [[ $(cargo mutants --version 2>/dev/null) != "cargo-mutants $version" ]]; then
    CARGO_TARGET_DIR=$tools/build cargo install --debug --quiet --locked --root "$tools" "cargo-mutants@$version"
fi

out=$target/mutants
mkdir -p "$out"
areas=(physics effects plant control fmi2 campaign gap)
diff=()
if [[ ${1:-} == --changed ]]; then
    base=${2:-HEAD^}
    git rev-parse --quiet --verify "$base^{commit}" >/dev/null || { echo "mutants.sh: no commit $base to compare with: nothing is tried"; exit 0; }
    git diff "$base" -- src >"$out/changed.diff"
    diff=(--in-diff "$out/changed.diff")
    touched=()
    for area in "${areas[@]}"; do git diff --quiet "$base" -- "src/$area" || touched+=("$area"); done
    ((${#touched[@]})) || { echo "mutants.sh: nothing in ${areas[*]} differs from $base"; exit 0; }
    set -- "${touched[@]}"
fi
(($#)) || set -- "${areas[@]}"

# The tests that cover an area, fastest first; the first group needs only the library of the FMUs.
tests() {
    case $1 in
    effects) echo val_effects val_physics effects_null ;;
    physics) echo val_effects val_physics val_inverse_map val_plant val_switched val_oracle val_work ;;
    plant) echo val_effects val_physics val_plant val_switched val_rest val_energy val_oracle val_continuity val_work ;;
    control) echo val_control_promises val_control val_control_faults val_control_estimators val_control_governed regress_table2 ;;
    fmi2) echo fmi_refusals fmi_within_a_step fmi_tells fmi_resources fmi_realtime fmi_random fmi_abuse ;;
    campaign) echo campaign_guards campaign_defects campaign_formats campaign_random ;;
    gap) echo regress_gap gap_model empirical plan ;;
    *) echo "mutants.sh: no area $1 among ${areas[*]}" >&2 && exit 1 ;;
    esac
}

# A copy of the tracked and new files, in which the mutants are made.
copy=$out/tree
rm -rf "$copy"
mkdir -p "$copy"
git ls-files -z --cached --others --exclude-standard | while IFS= read -rd '' name; do [[ ! -e $name ]] || printf '%s\0' "$name"; done | tar -c --null -T - | tar -x -C "$copy"
# build.rs declares the effects in a generated file that cargo-mutants does not read, so the modules are declared for it here.
for name in "$copy"/src/effects/*.rs "$copy"/src/effects/simulated/*.rs; do
    [[ $name == */mod.rs ]] || printf '#[cfg(any())]\n#[path = "%s"]\nmod %s;\n' "${name#"$copy"/src/effects/}" "$(basename "$name" .rs)" >>"$copy/src/effects/mod.rs"
done

ends=$((SECONDS + 60 * ${MINUTES:-100000}))
tried=()
remaining=$#
for area in "$@"; do
    names=$(tests "$area")
    arguments=(-C=--lib)
    for name in $names; do
        [[ ! -e tests/$name.rs && ! -e tests/$name/main.rs ]] || arguments+=("-C=--test=$name")
    done
    case $area in physics | effects | plant | control | fmi2) arguments+=(--no-default-features) ;; campaign) arguments+=(--no-default-features --features campaign) ;; esac
    # The diagnosis needs the dependencies of the other tests. Where these are built they are copied, not linked: what a mutant makes must not replace what the tests made. Its own code is built
    # with little optimisation and incrementally, in a tenth of the time.
    building=()
    if [[ $area == gap ]]; then
        building=("CARGO_TARGET_DIR=$out/target" CARGO_INCREMENTAL=1)
        arguments+=(--profile quick "-C=--config=profile.quick.package.kisspoint.opt-level=1" "-C=--config=profile.quick.package.kisspoint.codegen-units=256")
        if [[ -d $target/quick/deps && ! -d $out/target/quick ]]; then
            mkdir -p "$out/target/quick"
            tar -C "$target/quick" --exclude='*kisspoint*' -c deps build .fingerprint | tar -C "$out/target/quick" -x
        fi
    fi
    # Each area gets its share of the time that is left.
    left=$(((ends - SECONDS) / remaining--))
    ((left > 30)) || { echo "mutants.sh: no time left for $area"; continue; }
    printf '\n== %s\n' "$area"
    rm -rf "${out:?}/$area"
    # src/fmi2/sources.rs is compiled only for WebAssembly, and no test here runs it.
    # cargo mutants exits with 2 for survivors and 3 for time-outs, which are judged below; 124 means that the given time is over.
    status=0
    env "${building[@]}" timeout --signal=INT "$left" cargo mutants --no-config --dir "$copy" --in-place --minimum-test-timeout 20 --output "$out/$area" "${diff[@]}" \
        --file "src/$area/**" --exclude src/fmi2/sources.rs "${arguments[@]}" || status=$?
    case $status in 0 | 2 | 3 | 124 | 130) ;; *) echo "mutants.sh: cargo-mutants failed on $area" >&2 && exit 1 ;; esac
    tried+=("$out/$area/mutants.out")
done
((${#tried[@]})) || exit 0
exec "${PYTHON:-python3}" packaging/mutants.py packaging/mutants.txt "${tried[@]}"
