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
  double number = 0;
  if (value->getType() == XmlRpcValue::TypeInt) number = static_cast<int&>(*value);
  if (value->getType() == XmlRpcValue::TypeDouble) number = static_cast<double&>(*value);
  if (number > 0 && number <= most) return number;
  refuse(name, *value, "a number above 0, at most " + pmeta::significant(most, 6));
}

}  // namespace pmeta_nodes
