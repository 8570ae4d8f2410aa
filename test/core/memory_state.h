#pragma once

#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/state.h"

namespace pmeta::test {

/// A saved state in memory, which a test may spoil.
struct MemoryState {
  struct Array {
    StateType type = StateType::kUint8;
    std::vector<unsigned char> bytes;

    bool operator==(const Array& other) const { return type == other.type && bytes == other.bytes; }
  };
  std::map<std::string, Array> arrays;

  bool operator==(const MemoryState& other) const { return arrays == other.arrays; }

  template <class T>
  void set(const std::string& name, const std::vector<T>& values) {
    Array& array = arrays[name];
    array.type = stateTypeOf<T>();
    array.bytes.resize(values.size() * sizeof(T));
    if (!values.empty()) std::memcpy(array.bytes.data(), values.data(), array.bytes.size());
  }

  template <class T>
  std::vector<T> get(const std::string& name) const {
    const Array& array = arrays.at(name);
    std::vector<T> values(array.bytes.size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), array.bytes.data(), array.bytes.size());
    return values;
  }
};

class MemoryWriter : public StateWriter {
 public:
  explicit MemoryWriter(MemoryState& state) : state_(state) {}

 private:
  void put(const std::string& name, StateType type, const void* values, std::size_t n) override {
    const auto* bytes = static_cast<const unsigned char*>(values);
    const MemoryState::Array array{type, {bytes, bytes + n * byteSize(type)}};
    if (!state_.arrays.emplace(name, array).second) throw Error(name + " is saved twice.");
  }

  MemoryState& state_;
};

class MemoryReader : public StateReader {
 public:
  explicit MemoryReader(const MemoryState& state) : state_(state) {}

 private:
  std::size_t sizeOf(const std::string& name, StateType type) const override {
    const auto found = state_.arrays.find(name);
    if (found == state_.arrays.end()) throw Error("there is no " + name + ".");
    if (found->second.type != type) throw Error(name + " is no " + pmeta::name(type) + ".");
    return found->second.bytes.size() / byteSize(type);
  }
  void get(const std::string& name, StateType type, void* values, std::size_t n) const override {
    if (n > 0) std::memcpy(values, state_.arrays.at(name).bytes.data(), n * byteSize(type));
  }

  const MemoryState& state_;
};

template <class Component>
MemoryState stateOf(const Component& component) {
  MemoryState state;
  MemoryWriter writer(state);
  component.saveState(writer);
  return state;
}

template <class Component>
void load(Component& component, const MemoryState& state) {
  MemoryReader reader(state);
  component.loadState(reader);
}

}  // namespace pmeta::test
