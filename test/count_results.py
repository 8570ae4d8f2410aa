#!/usr/bin/python3
"""count_results.py DIR...: counts the test cases in the JUnit files below DIR.

Prints failures and then 'N passed, N failed, N skipped'. Exits with 1 if anything failed or crashed,
with 2 if no test ran. (catkin_test_results counts each gtest case twice, so it is not used.)
"""
import pathlib
import sys
import xml.etree.ElementTree as ElementTree


def count_file(path):
    """(passed, failed, skipped, names of failures) of one result file."""
    if path.name.startswith("MISSING-"):
        return 0, 1, 0, ["%s: no result, did it crash?" % path.name]
    try:
        root = ElementTree.parse(str(path)).getroot()
    except ElementTree.ParseError:
        return 0, 1, 0, ["%s: unreadable, did it crash?" % path.name]
    # rostest wraps the results of its programs in a file of its own, which only counts when it fails
    is_wrapper = path.name.startswith("rostest-")
    passed = failed = skipped = 0
    names = []
    for case in root.iter("testcase"):
        if any(child.tag in ("failure", "error") for child in case):
            failed += 1
            names.append("%s: %s.%s" % (path.stem, case.get("classname"), case.get("name")))
        elif case.get("status") == "notrun" or case.find("skipped") is not None:
            skipped += 1
        elif not is_wrapper:
            passed += 1
    return passed, failed, skipped, names


def main(folders):
    files = sorted(path for folder in folders for path in pathlib.Path(folder).rglob("*.xml"))
    totals = [0, 0, 0]
    for path in files:
        *counts, names = count_file(path)
        totals = [total + count for total, count in zip(totals, counts)]
        for name in names:
            print("FAILED", name)
    print("%d passed, %d failed, %d skipped" % tuple(totals))
    return 1 if totals[1] else 0 if totals[0] else 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
