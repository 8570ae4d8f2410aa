#include "pmeta_core/base/state.h"

#include <cmath>

#include "pmeta_core/base/error.h"

namespace pmeta {

const char* name(StateType type) {
  switch (type) {
    case StateType::kFloat32:
      return "float32";
    case StateType::kFloat64:
      return "float64";
    case StateType::kInt64:
      return "int64";
    case StateType::kUint64:
      return "uint64";
    case StateType::kUint8:
      return "uint8";
    case StateType::kText:
      break;
  }
  return "text";
}

std::size_t byteSize(StateType type) {
  if (type == StateType::kUint8 || type == StateType::kText) return 1;
  return type == StateType::kFloat32 ? 4 : 8;
}

std::int64_t StateReader::count(const std::string& name, std::int64_t low,
                                std::int64_t high) const {
  const auto count = value<std::int64_t>(name);
  if (count < low || count > high) {
    refuse(name, "is " + std::to_string(count) + " but must be from " + std::to_string(low) +
                     " to " + std::to_string(high));
  }
  return count;
}

std::int64_t StateReader::count(const std::string& name) const {
  return count(name, 0, kMostCounted);
}

void StateReader::counts(const std::string& name, std::vector<std::int64_t>& counts) const {
  array(name, counts);
  for (const std::int64_t count : counts) {
    if (count < 0 || count > kMostCounted) {
      refuse(name, "holds " + std::to_string(count) + ", which is no count");
    }
  }
}

bool StateReader::flag(const std::string& name) const {
  const auto flag = value<std::uint8_t>(name);
  if (flag > 1) refuse(name, "is " + std::to_string(flag) + " but must be 0 or 1");
  return flag == 1;
}

double StateReader::finite(const std::string& name) const {
  const auto number = value<double>(name);
  if (!std::isfinite(number)) refuse(name, "is not finite");
  return number;
}

std::string StateReader::text(const std::string& name, std::size_t most) const {
  std::string text(checkedSize(name, StateType::kText, most), '\0');
  get(full(name), StateType::kText, text.data(), text.size());
  return text;
}

void StateReader::refuse(const std::string& name, const std::string& why) const {
  throw Error("the saved state does not fit this run: " + full(name) + " " + why + ".");
}

std::size_t StateReader::checkedSize(const std::string& name, StateType type,
                                     std::size_t most) const {
  const std::size_t n = sizeOf(full(name), type);
  if (n > most) {
    refuse(name, "has " + std::to_string(n) + " values but at most " + std::to_string(most) +
                     " have a place");
  }
  return n;
}

void StateReader::requireSize(const std::string& name, StateType type, std::size_t n) const {
  const std::size_t found = sizeOf(full(name), type);
  if (found != n) {
    refuse(name, "has " + std::to_string(found) + " values but must have " + std::to_string(n));
  }
}

}  // namespace pmeta
