#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

namespace pmeta {

/// What an array of a saved state holds.
enum class StateType { kFloat32, kFloat64, kInt64, kUint64, kUint8, kText };

const char* name(StateType type);      ///< "float32", ..., "text"
std::size_t byteSize(StateType type);  ///< of one value

/// Counters beyond this are refused, so that going on from one cannot overflow it.
constexpr std::int64_t kMostCounted = std::int64_t{1} << 53;

/// The type of arrays of T; no other types are saved.
template <class T>
constexpr StateType stateTypeOf() {
  if (std::is_same<T, float>::value) return StateType::kFloat32;
  if (std::is_same<T, double>::value) return StateType::kFloat64;
  if (std::is_same<T, std::int64_t>::value) return StateType::kInt64;
  if (std::is_same<T, std::uint64_t>::value) return StateType::kUint64;
  static_assert(std::is_same<T, float>::value || std::is_same<T, double>::value ||
                    std::is_same<T, std::int64_t>::value || std::is_same<T, std::uint64_t>::value ||
                    std::is_same<T, std::uint8_t>::value,
                "save such a value as one of the types of StateType");
  return StateType::kUint8;
}

/// The name of the component at hand, which goes before the names of its arrays.
class StatePath {
 protected:
  /// The array's name with those of the components around it.
  std::string full(const std::string& name) const { return prefix_ + name; }

  /// The component `name` until the end of the scope.
  class Scope {
   public:
    /// `path` must outlive it; scopes end in the reverse of their order.
    Scope(StatePath& path, const std::string& name) : path_(path), length_(path.prefix_.size()) {
      path_.prefix_ += name + "/";
    }
    ~Scope() { path_.prefix_.resize(length_); }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    StatePath& path_;
    std::size_t length_;
  };

 private:
  std::string prefix_;
};

/// Where components write all that their future depends on: named arrays, e.g. "replay/values".
///
/// A component has `void saveState(StateWriter&) const`, which hands over its own memory, and
/// `void loadState(StateReader&)`, which takes the same arrays back. What follows from settings is
/// not part of a state, nor are generators: each is keyed by (seed, task, stream, round), so that
/// between rounds none is alive.
class StateWriter : protected StatePath {
 public:
  virtual ~StateWriter() = default;

  /// `n` values from memory that need not outlive the call. Each name once.
  template <class T>
  void array(const std::string& name, const T* values, std::size_t n) {
    put(full(name), stateTypeOf<T>(), values, n);
  }

  /// A vector, whatever its allocator.
  template <class Vector>
  void array(const std::string& name, const Vector& values) {
    array(name, values.data(), values.size());
  }

  /// An array of one.
  template <class T>
  void value(const std::string& name, T value) {
    array(name, &value, 1);
  }
  /// A whole number, which StateReader::count() reads.
  void count(const std::string& name, std::int64_t count) { value(name, count); }
  /// As 0 or 1.
  void flag(const std::string& name, bool flag) { value(name, static_cast<std::uint8_t>(flag)); }

  /// Text without NUL characters.
  void text(const std::string& name, const std::string& text) {
    put(full(name), StateType::kText, text.data(), text.size());
  }

  /// What `component` writes, with "name/" before its names.
  template <class Component>
  void part(const std::string& name, const Component& component) {
    const Scope scope(*this, name);
    component.saveState(*this);
  }

 private:
  virtual void put(const std::string& name, StateType type, const void* values, std::size_t n) = 0;
};

/// Where components read what they wrote to a StateWriter. Nothing in it is to be trusted: sizes
/// are checked here, and what is used as an index or counter is read with the range it must be in.
///
/// Every failure throws Error with one sentence that names the array. A component whose loadState()
/// has thrown is in no defined state, but safe to destroy.
class StateReader : protected StatePath {
 public:
  virtual ~StateReader() = default;

  /// How many values the array has; at most `most`.
  template <class T>
  std::size_t size(const std::string& name, std::size_t most) const {
    return checkedSize(name, stateTypeOf<T>(), most);
  }

  /// Exactly `n` values.
  template <class T>
  void array(const std::string& name, T* values, std::size_t n) const {
    requireSize(name, stateTypeOf<T>(), n);
    get(full(name), stateTypeOf<T>(), values, n);
  }

  /// As many values as `values` has.
  template <class Vector>
  void array(const std::string& name, Vector& values) const {
    array(name, values.data(), values.size());
  }

  /// An array of one; a number may be NaN or infinite, see finite().
  template <class T>
  T value(const std::string& name) const {
    T value{};
    array(name, &value, 1);
    return value;
  }

  /// A whole number from `low` to `high`.
  std::int64_t count(const std::string& name, std::int64_t low, std::int64_t high) const;
  /// A counter: from 0 to kMostCounted.
  std::int64_t count(const std::string& name) const;
  /// As many counters as `counts` has.
  void counts(const std::string& name, std::vector<std::int64_t>& counts) const;
  /// 0 or 1.
  bool flag(const std::string& name) const;
  /// A finite number.
  double finite(const std::string& name) const;
  /// At most `most` characters.
  std::string text(const std::string& name, std::size_t most) const;

  /// What `component` reads, with "name/" before its names.
  template <class Component>
  void part(const std::string& name, Component& component) {
    const Scope scope(*this, name);
    component.loadState(*this);
  }

  /// Throws Error: the array, and why it cannot be part of this state, e.g. "holds no weights".
  [[noreturn]] void refuse(const std::string& name, const std::string& why) const;

 private:
  std::size_t checkedSize(const std::string& name, StateType type, std::size_t most) const;
  void requireSize(const std::string& name, StateType type, std::size_t n) const;

  /// Throws Error unless there is an array of that name and type; gives its number of values.
  virtual std::size_t sizeOf(const std::string& name, StateType type) const = 0;
  /// Writes the array's `n` values, which sizeOf() has given.
  virtual void get(const std::string& name, StateType type, void* values, std::size_t n) const = 0;
};

}  // namespace pmeta
