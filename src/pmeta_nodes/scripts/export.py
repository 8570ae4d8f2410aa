#!/usr/bin/python3
"""A trained policy as an ONNX model; `export.py --help` says how."""

import os
import sys

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from pmeta_files import PlotError
from pmeta_policies import read_policy
from pmeta_program import Parser, run_program


def parse_arguments(arguments):
    parser = Parser(
        prog="export", description="Writes a trained policy as an ONNX model, which runs where pMeta "
        "does not: observations in, the greedy action out, as policy_node answers. Scaling, "
        "squashing and what tells the task are part of it; names and units of its numbers stand in "
        "its metadata.",
        epilog="The model's input is observation [batch, numbers]; its output action, in [-1, 1] "
        "each, or for discrete actions action_values and action, the best one's number.")
    parser.add_argument("policy", metavar="POLICY_FILE",
                        help="policies/*.safetensors of a run, or of config/policies")
    parser.add_argument("-o", "--out", metavar="FILE",
                        help="the file to write (default: POLICY_FILE with .onnx for .safetensors)")
    parser.add_argument("--task", type=int, metavar="I",
                        help="of a meta-policy that is told its task by a number: which one it shall act "
                        "on; without it the model has a second input, task_input")
    options = parser.parse_args(arguments)
    options.out = options.out or os.path.splitext(options.policy)[0] + ".onnx"
    return options


def run(arguments):
    options = parse_arguments(arguments)
    policy = read_policy(options.policy)
    try:
        import pmeta_onnx
    except ImportError:
        raise PlotError("ONNX for Python is missing (Debian: python3-onnx).")
    model = pmeta_onnx.model_of(policy, options.task)
    with open(options.out, "wb") as file:
        file.write(model.SerializeToString())
    print("wrote %s: %s to %s" % (options.out, shapes_text(model.graph.input),
                                  shapes_text(model.graph.output)))


def shapes_text(values):
    return ", ".join("%s [%s]" % (value.name, ", ".join(
        one.dim_param or str(one.dim_value) for one in value.type.tensor_type.shape.dim))
        for value in values)


def main(arguments):
    return run_program("export", run, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
