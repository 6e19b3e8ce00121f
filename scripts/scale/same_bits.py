#!/usr/bin/env python3
"""Compares two results of `montecarlo --json` number by number; times and commands may differ. Exit code 1 where they do not agree."""

import json
import sys


def numbers(path):
    result = json.load(open(path))
    for key in ("program", "trials_per_second", "seconds", "wall_s"):
        result.pop(key, None)
    return result


def main():
    first, second = map(numbers, sys.argv[1:3])
    different = [key for key in first.keys() | second.keys() if first.get(key) != second.get(key)]
    if different:
        sys.exit(f"{sys.argv[1]} and {sys.argv[2]} differ in: {', '.join(sorted(different))}")
    if "parameters" in first:
        count = sum(len(p) for p in first["parameters"])
        what = f"{len(first['parameters'])} parameters, {count} values"
    else:
        what = f"{len(first['targets'])} targets of a blind benchmark"
    print(f"same bits: {first['trials']} trials, {what}")


if __name__ == "__main__":
    main()
