// pmeta_local: experiments, sweeps and the theory's measurements in one process, without ROS
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/process.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/experiment/results_dir.h"
#include "pmeta_core/mjcf/design.h"
#include "pmeta_core/run/console.h"
#include "pmeta_core/run/loaded_policy.h"
#include "pmeta_core/run/local_runner.h"
#include "pmeta_core/run/policy_evaluation.h"
#include "pmeta_core/run/sweep.h"
#include "pmeta_core/run/trace.h"
#include "pmeta_core/security/authentication.h"
#include "pmeta_core/security/key_file.h"
#include "pmeta_core/storage/manifest.h"
#include "pmeta_core/theory/convergence.h"
#include "pmeta_core/verify/model_check.h"
#include "pmeta_core/verify/trajectory_check.h"

namespace {

using pmeta::duration;
using pmeta::Error;
using pmeta::Experiment;
using pmeta::shortNumber;

constexpr char kUsage[] =
    R"(usage: pmeta_local COMMAND ...

  run CONFIG [key:=value ...]          run an experiment in this process
  run CONFIG resume:=RUN_DIR           go on with a run that was stopped or killed, from its newest
                                       checkpoints and with its own settings
  sweep CONFIG key:=a,b,c ... [--name NAME] [--jobs N] [--resume] [--dry-run]
      run it for every combination of values; seed:=0-9 is a range. Run again to go on where it
      stopped: with the run that was cut off, or with --resume within it, from its checkpoints.
      --dry-run only lists the runs: status and folder. A run that fails keeps no other from being run:
      those are listed at the end, the exit code is 1, and the same command tries them again.
  convergence CONFIG [key:=value ...]  measure the theory's statements on known models
  check CONFIG [key:=value ...]        check the settings and print the effective ones as YAML
  key FILE                             make a key for key_file:=FILE; never overwrites
  settings CONFIG [key:=value ...]     list every setting: its value, the default and its meaning;
                                       settings mjcf: every term of a robot in YAML
  replay KIND FILE [--tasks FILE]      simulate recorded trajectories (CSV, also gzip) again and
      compare. KIND: ant, cartpole, half_cheetah, mountaincar, sparse_point, walker2d, walker2d_params.
      sparse_point and walker2d_params need the file of their tasks; of cartpole and mountaincar they
      are the paper's unless it is given. ant_model, half_cheetah_model, walker2d_model compare a file
      of figures of the compiled model instead.
  evaluate POLICY_FILE [--episodes N] [--task I]
                                       returns of a trained policy (policies/*.safetensors) on at least
                                       N (100) fresh episodes, of its own task or, meta, of every one
  trace RUN_DIR                        write trajectories.csv there: an episode of each last policy

Ctrl-C, SIGTERM or a closed terminal stops a run or a sweep when the round is over, a second one at
once; other commands end at once. That nobody reads the output any more (| head) stops nothing.
CONFIG is a YAML file, e.g. config/gridworld.yaml. A key may be shortened to its last part where that
is unambiguous (lambda for personal.lambda). Results go to results_dir, by default ~/.ros/pmeta.
)";

// a round of large networks takes minutes, and only whole ones are kept
constexpr char kAfterTheRound[] = "\nstopping when the round is over; once more stops at once\n";

struct Arguments {
  std::vector<std::string> words;  ///< all that is neither an option nor ROS's own remapping
  std::string name, tasks;
  int task = -1;  ///< -1: not given
  int episodes = 100;
  bool resume = false;
  bool dry_run = false;
  int jobs = std::max(1u, std::thread::hardware_concurrency());
};

int wholeNumber(const std::string& option, const std::string& text, int low, int high) {
  int number = 0;
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, number);
  if (result.ec != std::errc() || result.ptr != end || number < low || number > high) {
    throw Error(option + " is '" + text + "' but must be a whole number, from " +
                std::to_string(low) + " to " + std::to_string(high) + ".");
  }
  return number;
}

Arguments parseArguments(int argc, char** argv) {
  Arguments arguments;
  const auto value = [&](int& i) -> std::string {
    if (i + 1 >= argc) throw Error(std::string(argv[i]) + " needs a value.");
    return argv[++i];
  };
  for (int i = 2; i < argc; ++i) {
    const std::string word = argv[i];
    if (word.rfind("__", 0) == 0) continue;  // roslaunch adds __name:= and __log:=
    if (word == "--name") {
      arguments.name = value(i);
    } else if (word == "--tasks") {
      arguments.tasks = value(i);
    } else if (word == "--resume") {
      arguments.resume = true;
    } else if (word == "--dry-run") {
      arguments.dry_run = true;
    } else if (word == "--jobs") {
      arguments.jobs = wholeNumber(word, value(i), 1, 1024);
    } else if (word == "--task") {
      arguments.task = wholeNumber(word, value(i), 0, 1000000);
    } else if (word == "--episodes") {
      arguments.episodes = wholeNumber(word, value(i), 1, 1000000);
    } else if (word.rfind("-", 0) == 0) {
      throw Error("unknown option '" + word + "': see pmeta_local --help.");
    } else {
      arguments.words.push_back(word);
    }
  }
  return arguments;
}

std::string takeConfig(Arguments& arguments) {
  if (arguments.words.empty() || arguments.words.front().find(":=") != std::string::npos) {
    throw Error("which settings file? Give it first, e.g. config/gridworld.yaml.");
  }
  const std::string config = arguments.words.front();
  arguments.words.erase(arguments.words.begin());
  return config;
}

void printNotes(const Experiment& experiment) {
  for (const std::string& note : experiment.notes()) std::cerr << note << "\n";
}

// takes "resume:=RUN_DIR" out of the assignments; "" if it is not among them
std::string takeResume(Arguments& arguments) {
  const std::string key = "resume:=";
  std::string dir;
  std::vector<std::string> others;
  for (const std::string& word : arguments.words) {
    if (word.rfind(key, 0) != 0) {
      others.push_back(word);
    } else if ((dir = word.substr(key.size())).empty()) {
      throw Error("resume:= needs the folder of a run.");
    }
  }
  arguments.words = others;
  return dir;
}

Experiment loadExperiment(const std::string& config, const std::string& resume,
                          const Arguments& arguments) {
  return resume.empty() ? Experiment::load(config, arguments.words)
                        : Experiment::resume(resume, arguments.words, config);
}

// nobody else writes the folder from before the point is looked for
pmeta::RunLog reopen(const Experiment& experiment, pmeta::ResumePoint& point) {
  pmeta::requireResumable(experiment.runDir());
  pmeta::RunLock lock(experiment.runDir());
  point = pmeta::findResumePoint(experiment);
  for (const std::string& sentence : point.refused) std::cerr << sentence << "\n";
  return pmeta::RunLog::reopen(experiment, point.rounds_done, std::move(lock));
}

int run(Arguments arguments) {
  const std::string config = takeConfig(arguments);
  const std::string resume = takeResume(arguments);
  const Experiment experiment = loadExperiment(config, resume, arguments);
  pmeta::ResumePoint point;
  // takes long for large grids; until a run folder is begun, a signal ends the program at once
  experiment.optimalReturn(0);
  pmeta::heedStopSignals(kAfterTheRound);
  // before the manifest is written anew
  const std::string other_machine = resume.empty() ? "" : pmeta::otherMachine(experiment);
  pmeta::RunLog log = resume.empty() ? pmeta::RunLog(experiment) : reopen(experiment, point);
  std::cout << "settings\n" << experiment.table() << std::flush;
  printNotes(experiment);
  if (!other_machine.empty()) std::cerr << "warning: " << other_machine << "\n";
  if (point.round > 0) std::cout << "going on after round " << point.round << std::endl;
  pmeta::RunConsole console(experiment, isatty(STDOUT_FILENO) != 0);
  console.recall(log.dir() + "/rounds.csv");
  const pmeta::LocalResult result = pmeta::runLocally(
      experiment, &log,
      [&](const pmeta::RoundBook::Round& round) {
        const std::string line = console.take(round);
        if (!line.empty()) std::cout << line << std::endl;
        return !pmeta::stopSignalled();
      },
      point.round);
  log.finish(result.stopped ? "stopped" : "finished");
  const std::int64_t broken =
      result.rounds.empty() ? 0 : result.rounds.back().summary.broken_episodes;
  if (broken > 0) {
    std::cerr << broken << " episodes broke down: take a smaller timestep in the model, or a "
              << "smaller learning_rate.\n";
  }
  std::cout << console.table() << (result.stopped ? "stopped; " : "")
            << pmeta::listRunFolder(log.dir()) << std::flush;
  return result.stopped ? 130 : 0;
}

// what a sweep would do; its runs are told a line each, for programs too
int listSweep(const pmeta::SweepPlan& plan) {
  const std::vector<Experiment> runs = pmeta::planSweep(plan);
  int open = 0;
  for (const Experiment& experiment : runs) {
    const std::string status = pmeta::runStatus(experiment.runDir());
    if (status != "finished" && status != "running") ++open;
    std::cout << (status.empty() ? "missing" : status) << " " << experiment.runDir() << "\n";
  }
  std::cout << std::flush;
  std::cerr << open << " of " << runs.size() << " runs are to be done\n";
  return 0;
}

int sweep(Arguments arguments) {
  pmeta::heedStopSignals(kAfterTheRound);
  pmeta::SweepPlan plan;
  plan.config = takeConfig(arguments);
  plan.assignments = arguments.words;
  plan.jobs = arguments.jobs;
  plan.name =
      arguments.name.empty() ? std::filesystem::path(plan.config).stem().string() : arguments.name;
  plan.resume = arguments.resume;
  if (arguments.dry_run) return listSweep(plan);
  int found = 0;
  const pmeta::SweepResult result =
      pmeta::runSweep(plan, pmeta::stopSignalled(), [&](const pmeta::SweepProgress& progress) {
        if (!progress.in_use.empty()) std::cerr << "left out: " << progress.in_use << std::endl;
        if (progress.skipped) ++found;
        if (progress.skipped || !progress.in_use.empty()) return;
        std::printf("[%d/%d] %s  PP %s  MP %s  %s  ETA %s\n", progress.done, progress.total,
                    progress.run_id.c_str(), shortNumber(progress.personal_return).c_str(),
                    shortNumber(progress.meta_return).c_str(), duration(progress.seconds).c_str(),
                    duration(progress.eta_seconds).c_str());
        std::fflush(stdout);
      });
  if (found > 0) std::cout << found << " runs had been finished before\n";
  if (result.in_use > 0) {
    std::cerr << result.in_use
              << " runs were left to whom else writes them: the same command sees to "
              << "what that leaves" << std::endl;
  }
  const int failed = static_cast<int>(result.failures.size());
  std::cout << (result.stopped ? "stopped; the same command goes on. Runs in " : "runs in ")
            << result.folder << std::endl;
  for (const pmeta::SweepFailure& failure : result.failures) {
    std::cerr << failure.run_id << ": " << failure.reason << "\n";
  }
  if (failed > 0) {
    std::cerr << "pmeta: " << failed << " of " << result.total
              << " runs failed; the same command tries them again." << std::endl;
  }
  return result.stopped ? 130 : (result.in_use + failed > 0 ? 1 : 0);
}

int check(Arguments arguments) {
  const std::string config = takeConfig(arguments);
  const std::string resume = takeResume(arguments);
  const Experiment experiment = loadExperiment(config, resume, arguments);
  if (!resume.empty()) pmeta::requireResumable(experiment.runDir());
  const pmeta::Authenticator probe(experiment.settings().key_file);
  printNotes(experiment);
  std::cout << experiment.yaml();
  return 0;
}

int settings(Arguments arguments) {
  const std::string config = takeConfig(arguments);
  if (config == pmeta::kMjcf) {
    std::cout << pmeta::describeTerms();
    return 0;
  }
  const YAML::Node name = pmeta::loadYamlFile(config)["experiment"];
  const bool theory = name && name.IsScalar() && name.Scalar() == "convergence";
  std::cout << (theory ? pmeta::describeConvergence(pmeta::loadConvergence(config, arguments.words))
                       : Experiment::load(config, arguments.words).describe());
  return 0;
}

int convergence(Arguments arguments) {
  const std::string config = takeConfig(arguments);
  const pmeta::ConvergenceSettings settings = pmeta::loadConvergence(config, arguments.words);
  const std::string dir = pmeta::convergenceDir(settings);
  pmeta::requireWritable(settings.results_dir);
  const bool terminal = isatty(STDERR_FILENO) != 0;
  const auto report =
      pmeta::measureConvergence(settings, [&](const std::string& what, double done) {
        std::fprintf(stderr, terminal ? "\r\033[K%3.0f %%  %s" : "%3.0f %%  %s\n", 100 * done,
                     what.c_str());
      });
  if (terminal) std::fprintf(stderr, "\r\033[K");
  pmeta::writeConvergence(report, dir);
  std::cout << pmeta::convergenceTable(report) << "results in " << dir << std::endl;
  return 0;
}

int makeKey(const Arguments& arguments) {
  if (arguments.words.size() != 1) throw Error("key needs the name of the file to make.");
  const std::string& file = arguments.words.front();
  pmeta::createKeyFile(file);
  std::cout << "key file: " << file << std::endl;
  return 0;
}

int replay(const Arguments& arguments) {
  if (arguments.words.size() != 2) {
    throw Error("replay needs the kind of trajectories (" + pmeta::join(pmeta::trajectoryKinds()) +
                ") or of a model (" + pmeta::join(pmeta::modelKinds()) +
                ") and one file, e.g. replay cartpole cartpole_traj.csv.");
  }
  if (pmeta::isModelKind(arguments.words[0])) {
    if (!arguments.tasks.empty()) throw Error("a model has no tasks: leave out --tasks.");
    const pmeta::ModelReport report = pmeta::checkModel(arguments.words[0], arguments.words[1]);
    std::cout << pmeta::modelTable(report) << std::flush;
    return report.ok() ? 0 : 1;
  }
  const pmeta::TrajectoryReport report =
      pmeta::checkTrajectories(arguments.words[0], arguments.words[1], arguments.tasks);
  std::cout << pmeta::trajectoryTable(report) << std::flush;
  return report.ok() ? 0 : 1;
}

int evaluate(const Arguments& arguments) {
  if (arguments.words.size() != 1) {
    throw Error("evaluate needs one policy file, e.g. RUN_FOLDER/policies/task_0.safetensors.");
  }
  // a meta-policy that is told its task is told each one in its turn
  const pmeta::LoadedPolicy policy(arguments.words[0], std::max(arguments.task, 0));
  const Experiment& experiment = policy.experiment();
  if (arguments.task >= experiment.totalTasks()) {
    throw Error("--task is " + std::to_string(arguments.task) + " but must be from 0 to " +
                std::to_string(experiment.totalTasks() - 1) + ".");
  }
  std::cout << policy.description() << std::endl;
  printNotes(experiment);
  const int only = arguments.task < 0 ? policy.task() : arguments.task;
  const pmeta::PolicyEvaluation evaluation(policy);
  for (int task = 0; task < experiment.totalTasks(); ++task) {
    if (only >= 0 && task != only) continue;
    const pmeta::ReturnStats stats = evaluation.on(task, arguments.episodes);
    std::printf("task %d %s  return %s +- %s over %d episodes\n", task,
                experiment.family().taskName(task).c_str(), shortNumber(stats.mean).c_str(),
                shortNumber(stats.std).c_str(), stats.episodes);
    std::fflush(stdout);
  }
  return 0;
}

int trace(const Arguments& arguments) {
  if (arguments.words.size() != 1) throw Error("trace needs the folder of one run.");
  pmeta::writeTrajectories(arguments.words[0]);
  std::cout << "wrote " << arguments.words[0] << "/trajectories.csv" << std::endl;
  return 0;
}

int dispatch(int argc, char** argv) {
  const std::string command = argc > 1 ? argv[1] : "";
  const bool wants_help = std::any_of(argv + 1, argv + argc, [](const char* word) {
    return std::strcmp(word, "--help") == 0 || std::strcmp(word, "-h") == 0;
  });
  if (wants_help || command == "help") {
    std::cout << kUsage;
    return 0;
  }
  if (command == "run") return run(parseArguments(argc, argv));
  if (command == "sweep") return sweep(parseArguments(argc, argv));
  if (command == "convergence") return convergence(parseArguments(argc, argv));
  if (command == "check") return check(parseArguments(argc, argv));
  if (command == "key") return makeKey(parseArguments(argc, argv));
  if (command == "settings") return settings(parseArguments(argc, argv));
  if (command == "replay") return replay(parseArguments(argc, argv));
  if (command == "evaluate") return evaluate(parseArguments(argc, argv));
  if (command == "trace") return trace(parseArguments(argc, argv));
  std::cerr << (command.empty() ? "" : "unknown command '" + command + "'\n") << kUsage;
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  pmeta::prepareProcess();
  try {
    const int code = dispatch(argc, argv);
    if (!pmeta::standardOutputIsWhole())
      throw Error("standard output cannot be written: is its disk full?");
    return code;
  } catch (const std::exception& error) {
    std::cerr << "pmeta: " << error.what() << std::endl;
    return 1;
  }
}
