#include "common/private_param.h"

#include <ros/ros.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <optional>
#include <sstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/nn/held_signals.h"

namespace pmeta_nodes {
namespace {

using XmlRpc::XmlRpcValue;

std::optional<XmlRpcValue> get(const std::string& name) {
  XmlRpcValue value;
  const ros::NodeHandle nh("~");
  // a signal would end the call to the master, and with it look as if nothing were set
  const pmeta::HeldSignals held_signals;
  if (!nh.getParam(name, value)) return std::nullopt;
  return value;
}

[[noreturn]] void refuse(const std::string& name, const XmlRpcValue& value,
                         const std::string& must) {
  std::ostringstream text;
  text << value;
  throw pmeta::Error("the private parameter " + name + " is " + pmeta::shown(text.str()) +
                     " but must be " + must + ": give _" + name + ":=VALUE.");
}

std::optional<double> numberOf(XmlRpcValue& value) {
  if (value.getType() == XmlRpcValue::TypeInt) return static_cast<int&>(value);
  if (value.getType() == XmlRpcValue::TypeDouble) return static_cast<double&>(value);
  return std::nullopt;
}

}  // namespace

bool privateFlag(const std::string& name, bool otherwise) {
  auto value = get(name);
  if (!value) return otherwise;
  if (value->getType() != XmlRpcValue::TypeBoolean) refuse(name, *value, "true or false");
  return static_cast<bool&>(*value);
}

std::string privateText(const std::string& name, const std::string& otherwise) {
  auto value = get(name);
  if (!value) return otherwise;
  if (value->getType() != XmlRpcValue::TypeString) refuse(name, *value, "text");
  return static_cast<std::string&>(*value);
}

std::vector<std::string> privateNames(const std::string& name) {
  auto value = get(name);
  std::vector<std::string> names;
  if (!value) return names;
  const char* const kMust = "a list of names, e.g. [elbow, wrist]";
  if (value->getType() != XmlRpcValue::TypeArray) refuse(name, *value, kMust);
  for (int k = 0; k < value->size(); ++k) {
    if ((*value)[k].getType() != XmlRpcValue::TypeString) refuse(name, *value, kMust);
    names.push_back(static_cast<std::string&>((*value)[k]));
  }
  return names;
}

std::map<std::string, double> privateNumbers(const std::string& name) {
  auto value = get(name);
  std::map<std::string, double> numbers;
  if (!value) return numbers;
  const char* const kMust = "a number for each name, e.g. {elbow: 0.5}";
  if (value->getType() != XmlRpcValue::TypeStruct) refuse(name, *value, kMust);
  for (auto& [key, one] : *value) {
    const std::optional<double> number = numberOf(one);
    if (!number) refuse(name, *value, kMust);
    numbers[key] = *number;
  }
  return numbers;
}

int privateIndex(const std::string& name, int otherwise, int most) {
  auto value = get(name);
  if (!value) return otherwise;
  if (value->getType() == XmlRpcValue::TypeInt) {
    const int index = static_cast<int&>(*value);
    if (index >= 0 && index <= most) return index;
  }
  refuse(name, *value, "a whole number from 0 to " + std::to_string(most));
}

double privatePositive(const std::string& name, double otherwise, double most) {
  auto value = get(name);
  if (!value) return otherwise;
  const double number = numberOf(*value).value_or(0);
  if (number > 0 && number <= most) return number;
  refuse(name, *value, "a number above 0, at most " + pmeta::significant(most, 6));
}

}  // namespace pmeta_nodes
