#include "launch/xml_rpc.h"

#include <ros/network.h>

#include <algorithm>
#include <memory>

namespace pmeta_nodes {
namespace {

using XmlRpc::XmlRpcDispatch;
using XmlRpc::XmlRpcValue;

constexpr char kCaller[] = "/pmeta_launch";
constexpr double kTick = 0.02;  // seconds

// [code, status message, value], where code 1 is success
std::optional<XmlRpcValue> valueOf(XmlRpcValue& response) {
  if (response.getType() != XmlRpcValue::TypeArray || response.size() != 3 ||
      response[0].getType() != XmlRpcValue::TypeInt || static_cast<int>(response[0]) != 1) {
    return std::nullopt;
  }
  return response[2];
}

}  // namespace

std::vector<std::optional<XmlRpcValue>> callAll(const std::vector<XmlRpcCall>& calls,
                                                std::chrono::duration<double> patience) {
  using Clock = std::chrono::steady_clock;
  XmlRpcDispatch dispatch;
  std::vector<std::unique_ptr<XmlRpc::XmlRpcClient>> clients(calls.size());
  for (std::size_t i = 0; i < calls.size(); ++i) {
    std::string host;
    std::uint32_t port = 0;
    if (!ros::network::splitURI(calls[i].uri, host, port)) continue;
    XmlRpcValue arguments;
    arguments[0] = kCaller;
    for (const std::string& argument : calls[i].arguments) arguments[arguments.size()] = argument;
    auto client = std::make_unique<XmlRpc::XmlRpcClient>(host.c_str(), static_cast<int>(port), "/");
    if (!client->executeNonBlock(calls[i].method.c_str(), arguments)) continue;
    dispatch.addSource(client.get(), XmlRpcDispatch::WritableEvent | XmlRpcDispatch::Exception);
    clients[i] = std::move(client);
  }

  std::vector<std::optional<XmlRpcValue>> values(calls.size());
  const Clock::time_point limit =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(patience);
  while (Clock::now() < limit &&
         std::any_of(clients.begin(), clients.end(),
                     [](const auto& client) { return client != nullptr; })) {
    dispatch.work(kTick);
    for (std::size_t i = 0; i < clients.size(); ++i) {
      if (!clients[i]) continue;
      XmlRpcValue response;
      const bool done = clients[i]->executeCheckDone(response);
      if (done && !clients[i]->isFault()) values[i] = valueOf(response);
      // one that could not connect has no socket any more
      if (!done && clients[i]->getfd() >= 0) continue;
      dispatch.removeSource(clients[i].get());
      clients[i].reset();
    }
  }
  for (const auto& client : clients) {
    if (client) dispatch.removeSource(client.get());
  }
  return values;
}

}  // namespace pmeta_nodes
