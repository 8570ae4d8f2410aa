#include "pmeta_core/storage/policy_file.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/experiment/results_dir.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta {
namespace {

using Json = nlohmann::json;

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "policy files are little-endian");

constexpr std::size_t kLengthBytes = 8;
constexpr std::uint64_t kMaxHeader = 1 << 20;  // what JSON makes of it in memory is many times that
constexpr char kPresent[] = ".present";

// a tensor of a header: the bytes [begin, end) behind it
struct Tensor {
  std::string name, dtype;
  std::vector<std::size_t> shape;
  std::uint64_t begin = 0, end = 0;
};

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Error(path + " is not a policy file of pMeta: " + why + ".");
}

const char* dtypeOf(Precision precision) {
  return precision == Precision::kFloat32 ? "F32" : "F64";
}

// 0 if the type is none of ours
std::size_t scalarSize(const std::string& dtype) {
  return dtype == "F64" ? 8 : dtype == "F32" ? 4 : dtype == "U8" ? 1 : 0;
}

unsigned char* writableBytes(Model& model) {
  return std::visit([](auto& v) { return reinterpret_cast<unsigned char*>(v.data()); },
                    model.values);
}

// the text between quotes might be anything: errors show only so much of it
std::string shown(const std::string& name) {
  return "'" + (name.size() > 60 ? name.substr(0, 60) + "..." : name) + "'";
}

std::uint64_t readNumber(const Json& value, const std::string& path, const std::string& name) {
  if (!value.is_number_unsigned()) {
    refuse(path, "the shape or offsets of " + shown(name) + " are not whole numbers");
  }
  return value.get<std::uint64_t>();
}

Tensor readTensor(const std::string& path, const std::string& name, const Json& entry,
                  std::uint64_t data_size) {
  const auto isList = [&](const char* key) { return entry.contains(key) && entry[key].is_array(); };
  if (!entry.is_object() || !entry.contains("dtype") || !entry["dtype"].is_string() ||
      !isList("shape") || !isList("data_offsets") || entry["data_offsets"].size() != 2) {
    refuse(path, "tensor " + shown(name) + " lacks its dtype, shape or data_offsets");
  }
  Tensor tensor;
  tensor.name = name;
  tensor.dtype = entry["dtype"].get<std::string>();
  tensor.begin = readNumber(entry["data_offsets"][0], path, name);
  tensor.end = readNumber(entry["data_offsets"][1], path, name);
  if (tensor.begin > tensor.end || tensor.end > data_size) {
    refuse(path, "tensor " + shown(name) + " lies outside of the file; is it cut off?");
  }
  std::uint64_t bytes = scalarSize(tensor.dtype);
  if (bytes == 0) {
    refuse(path,
           "tensor " + shown(name) + " is of type " + shown(tensor.dtype) + ", not F32, F64 or U8");
  }
  for (const Json& value : entry["shape"]) {
    const std::uint64_t extent = readNumber(value, path, name);
    if (extent == 0 || bytes > data_size / extent) {
      refuse(path, "tensor " + shown(name) + " does not fit in the file");
    }
    bytes *= extent;
    tensor.shape.push_back(extent);
  }
  if (bytes != tensor.end - tensor.begin) {
    refuse(path, "the shape and offsets of tensor " + shown(name) + " contradict each other");
  }
  return tensor;
}

// the file's tensors by name, which together fill the bytes behind the header
std::map<std::string, Tensor> readTensors(const std::string& path, const Json& header,
                                          std::uint64_t data_size) {
  std::vector<Tensor> tensors;
  for (const auto& item : header.items()) {
    if (item.key() == "__metadata__") continue;
    tensors.push_back(readTensor(path, item.key(), item.value(), data_size));
  }
  std::sort(tensors.begin(), tensors.end(), [](const Tensor& a, const Tensor& b) {
    return std::make_pair(a.begin, a.end) < std::make_pair(b.begin, b.end);
  });
  std::uint64_t end = 0;
  for (const Tensor& tensor : tensors) {
    if (tensor.begin != end) refuse(path, "its tensors overlap or leave gaps");
    end = tensor.end;
  }
  if (end != data_size) refuse(path, "there is more in it than its tensors");
  std::map<std::string, Tensor> by_name;
  for (const Tensor& tensor : tensors) by_name.emplace(tensor.name, tensor);
  return by_name;
}

Json readHeader(const std::string& path, std::ifstream& file, std::uint64_t file_size,
                std::uint64_t& length) {
  unsigned char bytes[kLengthBytes];
  if (file_size < kLengthBytes || !file.read(reinterpret_cast<char*>(bytes), kLengthBytes)) {
    refuse(path, "it is too short");
  }
  std::memcpy(&length, bytes, kLengthBytes);
  if (length > file_size - kLengthBytes || length > kMaxHeader) {
    refuse(path, "its header is longer than the file or than 1 MB");
  }
  std::string text(length, '\0');
  if (!file.read(text.data(), static_cast<std::streamsize>(length))) {
    refuse(path, "it cannot be read to its end");
  }
  Json header = Json::parse(text, nullptr, false);
  if (!header.is_object()) refuse(path, "its header is not a JSON object");
  return header;
}

std::map<std::string, std::string> readMetadata(const std::string& path, const Json& header) {
  std::map<std::string, std::string> metadata;
  if (!header.contains("__metadata__") || !header["__metadata__"].is_object()) {
    refuse(path, "it has no __metadata__");
  }
  for (const auto& item : header["__metadata__"].items()) {
    if (!item.value().is_string()) refuse(path, shown(item.key()) + " in __metadata__ is no text");
    metadata[item.key()] = item.value().get<std::string>();
  }
  return metadata;
}

// finds the tensors of every block; whatever else is in the file is an error
class TensorReader {
 public:
  TensorReader(const std::string& path, std::ifstream& file, std::uint64_t data_start,
               std::map<std::string, Tensor> tensors)
      : path_(path), file_(file), data_start_(data_start), tensors_(std::move(tensors)) {}

  bool has(const std::string& name) const { return tensors_.count(name) != 0; }

  // throws Error unless there are these tensors and no others; nothing is allocated before
  void check(const ModelLayout& layout, bool masked) const {
    for (const Block& block : layout.blocks()) {
      checkTensor(block, block.name, dtypeOf(layout.precision()));
      if (masked) checkTensor(block, block.name + kPresent, "U8");
    }
    if (tensors_.size() != layout.blocks().size() * (masked ? 2 : 1)) {
      refuse(path_, "it has tensors that are not in its layout");
    }
  }

  void read(const std::string& name, unsigned char* out) {
    const Tensor& tensor = tensors_.at(name);
    file_.seekg(static_cast<std::streamoff>(data_start_ + tensor.begin));
    if (!file_.read(reinterpret_cast<char*>(out),
                    static_cast<std::streamsize>(tensor.end - tensor.begin))) {
      refuse(path_, "it cannot be read to its end");
    }
  }

 private:
  void checkTensor(const Block& block, const std::string& name, const std::string& dtype) const {
    const auto it = tensors_.find(name);
    if (it == tensors_.end()) refuse(path_, "tensor " + shown(name) + " is missing");
    if (it->second.dtype != dtype || it->second.shape != block.shape) {
      refuse(path_, "tensor " + shown(name) + " has another type or shape than its layout says");
    }
  }

  const std::string& path_;
  std::ifstream& file_;
  std::uint64_t data_start_;
  std::map<std::string, Tensor> tensors_;
};

// null where there is no bound: JSON has no infinity
Json boundOf(double bound) { return std::isfinite(bound) ? Json(bound) : Json(); }

std::string describe(const std::vector<Quantity>& quantities) {
  Json list = Json::array();
  for (const Quantity& one : quantities) {
    list.push_back({{"name", one.name},
                    {"unit", one.unit},
                    {"low", boundOf(one.low)},
                    {"high", boundOf(one.high)}});
  }
  return list.dump();
}

ModelLayout parseLayout(const std::string& path, const std::string& text) {
  try {
    return ModelLayout::parse(text);
  } catch (const Error& error) {
    throw Error(path + " is not a policy file of pMeta: " + error.what());
  }
}

}  // namespace

void savePolicy(const std::string& path, const Model& model,
                std::map<std::string, std::string> metadata) {
  const ModelLayout& layout = model.layout;
  const std::size_t scalar = layout.precision() == Precision::kFloat32 ? 4 : 8;
  if (model.byteCount() != layout.size() * scalar ||
      (!model.present.empty() && model.present.size() != layout.size())) {
    throw Error("a policy cannot be saved: its values do not fit its layout.");
  }
  metadata["layout"] = layout.text();

  Json header;
  header["__metadata__"] = metadata;
  std::uint64_t offset = 0;
  const auto add = [&](const std::string& name, const Block& block, const char* dtype) {
    const std::uint64_t end = offset + block.size() * scalarSize(dtype);
    header[name] = {{"dtype", dtype}, {"shape", block.shape}, {"data_offsets", {offset, end}}};
    offset = end;
  };
  for (const Block& block : layout.blocks()) add(block.name, block, dtypeOf(layout.precision()));
  if (!model.present.empty()) {
    for (const Block& block : layout.blocks()) add(block.name + kPresent, block, "U8");
  }
  // blanks make the values begin at a multiple of 8 bytes; text that is no UTF-8 is mended
  std::string text = header.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize((text.size() + 7) / 8 * 8, ' ');

  const std::uint64_t length = text.size();
  std::string bytes(reinterpret_cast<const char*>(&length), kLengthBytes);
  bytes.reserve(kLengthBytes + text.size() + offset);
  bytes += text;
  bytes.append(reinterpret_cast<const char*>(model.bytes()), model.byteCount());
  bytes.append(model.present.begin(), model.present.end());
  writeFileAtomically(path, bytes);
}

PolicyFile loadPolicy(const std::string& path) {
  requireRegularFile(path, "the policy file");
  std::error_code error;
  const std::uint64_t file_size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file) {
    throw Error("cannot read the policy file " + path + " (" +
                (error ? error.message() : std::strerror(errno)) + ").");
  }
  std::uint64_t length = 0;
  const Json header = readHeader(path, file, file_size, length);
  const std::uint64_t data_start = kLengthBytes + length;

  PolicyFile policy;
  policy.metadata = readMetadata(path, header);
  const auto layout = policy.metadata.find("layout");
  if (layout == policy.metadata.end()) refuse(path, "its __metadata__ has no layout");
  const ModelLayout expected = parseLayout(path, layout->second);
  TensorReader reader(path, file, data_start, readTensors(path, header, file_size - data_start));
  const bool masked = reader.has(expected.blocks().front().name + kPresent);
  reader.check(expected, masked);

  policy.model = Model(expected);
  if (masked) policy.model.present.resize(expected.size());
  unsigned char* values = writableBytes(policy.model);
  unsigned char* present = policy.model.present.data();
  for (const Block& block : expected.blocks()) {
    reader.read(block.name, values);
    values += block.size() * scalarSize(dtypeOf(expected.precision()));
    if (!masked) continue;
    reader.read(block.name + kPresent, present);
    present += block.size();
  }
  for (const std::uint8_t flag : policy.model.present) {
    if (flag > 1) refuse(path, "its presence mask holds other numbers than 0 and 1");
  }
  checkModel(policy.model, expected, "the file " + path);
  return policy;
}

std::map<std::string, std::string> policyMetadata(const Experiment& experiment,
                                                  const PolicyOrigin& origin) {
  const ExperimentSettings& settings = experiment.settings();
  const auto env = experiment.family().make(origin.policy == PolicyKind::kMeta ? 0 : origin.task);
  const EnvSpec& spec = env->spec();
  const PolicyForm form = experiment.policies(*env)->form();
  std::map<std::string, std::string> metadata = {
      {"environment", settings.environment},
      {"learner", experiment.hasMetaLearner() ? settings.algorithm : settings.learner},
      {"policy", name(origin.policy)},
      {"round", std::to_string(origin.round)},
      {"run_id", settings.run_id},
      {"observation_size", std::to_string(spec.observation_size)},
      {"num_actions", std::to_string(spec.num_actions)},
      {"observation", describe(observationsOf(spec))},
      {"action", describe(actionsOf(spec))},
      {"hidden_activation", form.hidden_activation},
      {"output_squashing", form.output_squashing},
      {"input_scaling", form.input_scaling},
      {"output_scaling", form.output_scaling},
      {"settings", experiment.runYaml()}};
  if (!form.network.empty()) metadata["network"] = form.network;
  if (form.heads > 1) metadata["heads"] = std::to_string(form.heads);
  if (!spec.choices.empty()) metadata["choices"] = Json(spec.choices).dump();
  if (spec.step_seconds > 0) metadata["step_seconds"] = formatNumber(spec.step_seconds);
  if (const ModelChoice* model = experiment.model()) {
    metadata["model_hash"] = model->hash;
    if (!model->file.empty()) metadata["model_file"] = model->file;
  }
  if (origin.policy == PolicyKind::kPersonal) metadata["task"] = std::to_string(origin.task);
  if (origin.mean_return) metadata["return"] = formatNumber(*origin.mean_return);
  if (!origin.task_input.empty()) {
    std::vector<std::string> numbers;
    for (const float value : origin.task_input) numbers.push_back(formatNumber(value));
    metadata["task_input"] = join(numbers, ",");
  }
  return metadata;
}

std::string policiesFolder(Kept kept) { return kept == Kept::kLast ? "policies" : "policies/best"; }

std::string policyPath(const std::string& run_dir, Kept kept, PolicyKind policy, int task) {
  const std::string whose = policy == PolicyKind::kMeta ? "meta" : "task_" + std::to_string(task);
  return run_dir + "/" + policiesFolder(kept) + "/" + whose + ".safetensors";
}

void saveRunPolicy(const Experiment& experiment, Kept kept, const PolicyOrigin& origin,
                   const Model& model) {
  requireWritable(experiment.runDir() + "/" + policiesFolder(kept));
  savePolicy(policyPath(experiment.runDir(), kept, origin.policy, origin.task), model,
             policyMetadata(experiment, origin));
}

}  // namespace pmeta
