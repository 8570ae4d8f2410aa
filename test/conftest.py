"""Options of the whole test suite."""


def pytest_addoption(parser):
    parser.addoption("--long", action="store_true",
                     help="also run the commands of the documents that take longer than a minute")
