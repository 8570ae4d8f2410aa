#include "pmeta_core/env/model_files.h"

#include <tinyxml2.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/hash.h"

namespace pmeta {
namespace {

namespace fs = std::filesystem;

constexpr char kWhat[] = "the model file";

/// Goes through an MJCF and the files that it includes.
class Finder {
 public:
  explicit Finder(const fs::path& mjcf) : folder_(mjcf.parent_path()) {
    read(mjcf);
    // whichever of the places it is where MuJoCo looks: those that are there count
    for (const std::string& name : assets_) {
      for (const std::string& dir : dirs_) add(folder_ / dir / name);
    }
    files_.erase(mjcf);
  }

  const std::set<fs::path>& others() const { return files_; }

 private:
  void read(const fs::path& mjcf) {
    const std::string text = readFile(mjcf.string(), kWhat);
    tinyxml2::XMLDocument document;
    // what is no XML is MuJoCo's to refuse
    if (document.Parse(text.data(), text.size()) == tinyxml2::XML_SUCCESS) {
      visit(*document.RootElement(), mjcf);
    }
  }

  void visit(const tinyxml2::XMLElement& element, const fs::path& mjcf) {
    const std::string kind = element.Name();
    for (const auto* a = element.FirstAttribute(); a != nullptr; a = a->Next()) {
      const std::string key = a->Name();
      const std::string value = a->Value();
      const bool is_dir = key.size() > 3 && key.compare(key.size() - 3, 3, "dir") == 0;
      if (kind == "compiler" && is_dir) dirs_.insert(value);
      // fileright and the like are the sides of a texture
      if (key.rfind("file", 0) != 0) continue;
      if (fs::path(value).is_absolute()) {
        throw Error("the model file " + mjcf.string() + " names " + value +
                    " with its full path: name it from the model's folder, so that a run can keep "
                    "a copy of both.");
      }
      if (kind != "include") {
        assets_.insert(value);
        // where paths are stripped, as of a URDF's package://robot/meshes/arm.stl
        assets_.insert(fs::path(value).filename().string());
      } else if (add(folder_ / value)) {
        read((folder_ / value).lexically_normal());
      }
    }
    for (const auto* c = element.FirstChildElement(); c != nullptr; c = c->NextSiblingElement()) {
      visit(*c, mjcf);
    }
  }

  // is it there, and new?
  bool add(const fs::path& file) {
    return fs::is_regular_file(file) && files_.insert(file.lexically_normal()).second;
  }

  fs::path folder_;  // of the MJCF, from which all is named
  std::set<fs::path> files_;
  std::set<std::string> assets_;
  std::set<std::string> dirs_ = {""};
};

std::string hashOf(const ModelFiles& files) {
  const auto bytes = [&](const std::string& name) {
    return readFile(files.folder + "/" + name, kWhat);
  };
  if (files.names.size() == 1) return hashText(bytes(files.names.front()));
  std::string lines;
  for (const std::string& name : files.names) lines += hashText(bytes(name)) + " " + name + "\n";
  return hashText(lines);
}

}  // namespace

ModelFiles ModelFiles::find(const std::string& mjcf) {
  const fs::path main = fs::absolute(mjcf).lexically_normal();
  const Finder finder(main);
  fs::path folder = main.parent_path();
  const auto holds = [&](const fs::path& file) {
    return *file.lexically_relative(folder).begin() != "..";
  };
  while (!std::all_of(finder.others().begin(), finder.others().end(), holds)) {
    folder = folder.parent_path();
  }
  ModelFiles files;
  files.folder = folder.string();
  files.names.push_back(main.lexically_relative(folder).string());
  for (const fs::path& file : finder.others()) {
    files.names.push_back(file.lexically_relative(folder).string());
  }
  files.hash = hashOf(files);
  return files;
}

void ModelFiles::copyTo(const std::string& dir) const {
  for (const std::string& name : names) {
    const fs::path copy = fs::path(dir) / name;
    std::error_code error;
    fs::create_directories(copy.parent_path(), error);
    if (!error) fs::copy_file(fs::path(folder) / name, copy, error);
    if (error) {
      throw Error("the model file " + folder + "/" + name + " cannot be copied to " + dir + " (" +
                  error.message() + ").");
    }
  }
  if (find(dir + "/" + names.front()).hash != hash) {
    throw Error("the model file " + folder + "/" + names.front() +
                ", or one that it names, has changed since it was read: start again.");
  }
}

}  // namespace pmeta
