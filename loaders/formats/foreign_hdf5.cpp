#include "loaders/formats/foreign_hdf5.h"

#include <utility>

#include "loaders/formats/hdf5_claims.h"

namespace q3d::loaders::formats {
namespace {

using manifests::hdf5::check;
using manifests::hdf5::Handle;

// Reads texts of variable length, which HDF5 allocates one by one.
std::vector<std::string> variable_texts(hid_t dataset, hid_t space, std::uint64_t count,
                                        const std::string& name) {
  const Handle type(H5Tcopy(H5T_C_S1), H5Tclose, name);
  check(H5Tset_size(type.get(), H5T_VARIABLE), name);
  const Handle stored(H5Dget_type(dataset), H5Tclose, name);
  check(H5Tset_cset(type.get(), H5Tget_cset(stored.get())), name);
  std::vector<char*> pointers(count, nullptr);
  check(H5Dread(dataset, type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, pointers.data()), name);
  std::vector<std::string> texts;
  texts.reserve(pointers.size());
  for (const char* pointer : pointers) texts.emplace_back(pointer == nullptr ? "" : pointer);
  check(H5Dvlen_reclaim(type.get(), space, H5P_DEFAULT, pointers.data()), name);
  return texts;
}

}  // namespace

ForeignHdf5::ForeignHdf5(const std::filesystem::path& file)
    : owned_(std::in_place, H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose, "HDF5"),
      file_(owned_->get()),
      file_bytes_(std::filesystem::file_size(file)) {}

bool ForeignHdf5::has(const std::string& name, H5O_type_t kind) const {
  H5L_info_t link{};
  H5O_info_t object{};
  return H5Lexists(file_, name.c_str(), H5P_DEFAULT) > 0 &&
         H5Lget_info(file_, name.c_str(), &link, H5P_DEFAULT) >= 0 && link.type == H5L_TYPE_HARD &&
         H5Oget_info_by_name(file_, name.c_str(), &object, H5P_DEFAULT) >= 0 && object.type == kind;
}

bool ForeignHdf5::has_dataset(const std::string& name) const {
  return has(name, H5O_TYPE_DATASET);
}

bool ForeignHdf5::has_group(const std::string& name) const {
  return has(name, H5O_TYPE_GROUP);
}

// `element_bytes` is the size of an element in memory; 0 takes the size that the file states.
ForeignHdf5::Opened ForeignHdf5::open(const std::string& name, std::uint64_t element_bytes) const {
  if (!has_dataset(name)) refuse(name, "nothing", "a dataset of this name");
  ClaimedDataset dataset = open_dataset(file_, name, name);
  const std::uint64_t bytes = element_bytes > 0 ? element_bytes : H5Tget_size(dataset.type.get());
  const std::uint64_t count = checked_count(dataset, bytes, file_bytes_, name);
  return {std::move(dataset.id), std::move(dataset.type), std::move(dataset.extents), count};
}

std::vector<std::uint64_t> ForeignHdf5::extents(const std::string& name) const {
  const Opened dataset = open(name, 0);
  return {dataset.extents.begin(), dataset.extents.end()};
}

std::vector<double> ForeignHdf5::numbers(const std::string& name) const {
  const Opened dataset = open(name, sizeof(double));
  const H5T_class_t kind = H5Tget_class(dataset.type.get());
  if (kind != H5T_INTEGER && kind != H5T_FLOAT && kind != H5T_ENUM) refuse(name, "another type", "numbers");
  std::vector<double> values(dataset.count);
  if (values.empty()) return values;
  check(H5Dread(dataset.id.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), name);
  return values;
}

std::vector<std::string> ForeignHdf5::texts(const std::string& name) const {
  const Opened dataset = open(name, 0);
  if (H5Tget_class(dataset.type.get()) != H5T_STRING) {
    // Without tracks, SLEAP writes an empty list of floats.
    if (dataset.count == 0) return {};
    refuse(name, "another type", "texts");
  }
  if (dataset.count == 0) return {};
  const Handle space(H5Dget_space(dataset.id.get()), H5Sclose, name);
  if (H5Tis_variable_str(dataset.type.get()) > 0) {
    return variable_texts(dataset.id.get(), space.get(), dataset.count, name);
  }
  const std::size_t width = H5Tget_size(dataset.type.get());
  std::string bytes(width * dataset.count, '\0');
  check(H5Dread(dataset.id.get(), dataset.type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), name);
  std::vector<std::string> texts;
  for (std::size_t at = 0; at < bytes.size(); at += width) texts.push_back(text_from(&bytes[at], width));
  return texts;
}

std::vector<std::string> ForeignHdf5::fields(const std::string& name) const {
  const Opened dataset = open(name, 0);
  if (H5Tget_class(dataset.type.get()) != H5T_COMPOUND) refuse(name, "another type", "a table");
  std::vector<std::string> names;
  const int members = check(H5Tget_nmembers(dataset.type.get()), name);
  for (int i = 0; i < members; ++i) {
    char* field = H5Tget_member_name(dataset.type.get(), static_cast<unsigned>(i));
    if (field == nullptr) manifests::hdf5::throw_error(name);
    names.emplace_back(field);
    H5free_memory(field);
  }
  return names;
}

std::vector<double> ForeignHdf5::field(const std::string& name, const std::string& field) const {
  const Opened dataset = open(name, sizeof(double));
  const std::string where = name + "." + field;
  if (H5Tget_class(dataset.type.get()) != H5T_COMPOUND || dataset.extents.size() != 1)
    refuse(name, "another type", "a table");
  const int index = H5Tget_member_index(dataset.type.get(), field.c_str());
  if (index < 0) refuse(where, "nothing", "a field of this name");
  const H5T_class_t kind = H5Tget_member_class(dataset.type.get(), static_cast<unsigned>(index));
  if (kind != H5T_INTEGER && kind != H5T_FLOAT && kind != H5T_ENUM) refuse(where, "another type", "numbers");
  const Handle row(H5Tcreate(H5T_COMPOUND, sizeof(double)), H5Tclose, where);
  check(H5Tinsert(row.get(), field.c_str(), 0, H5T_NATIVE_DOUBLE), where);
  std::vector<double> values(dataset.count);
  if (values.empty()) return values;
  check(H5Dread(dataset.id.get(), row.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), where);
  return values;
}

std::optional<std::string> ForeignHdf5::text_attribute(const std::string& object,
                                                       const std::string& attribute) const {
  const std::string where = object + "." + attribute;
  const Handle holder(H5Oopen(file_, object.c_str(), H5P_DEFAULT), H5Oclose, object);
  const auto opened = open_attribute(holder.get(), attribute, file_bytes_, where);
  if (!opened) return std::nullopt;
  if (H5Tget_class(opened->type.get()) != H5T_STRING) refuse(where, "another type", "one text");
  if (H5Tis_variable_str(opened->type.get()) <= 0) return fixed_text(*opened, where);
  char* pointer = nullptr;
  check(H5Aread(opened->id.get(), opened->type.get(), &pointer), where);
  std::string text = pointer == nullptr ? "" : pointer;
  check(H5Dvlen_reclaim(opened->type.get(), opened->space.get(), H5P_DEFAULT, &pointer), where);
  return text;
}

std::optional<double> ForeignHdf5::number_attribute(const std::string& object,
                                                    const std::string& attribute) const {
  const std::string where = object + "." + attribute;
  const Handle holder(H5Oopen(file_, object.c_str(), H5P_DEFAULT), H5Oclose, object);
  const auto opened = open_attribute(holder.get(), attribute, file_bytes_, where);
  if (!opened) return std::nullopt;
  const H5T_class_t kind = H5Tget_class(opened->type.get());
  if (kind != H5T_INTEGER && kind != H5T_FLOAT) refuse(where, "another type", "one number");
  double value = 0.0;
  check(H5Aread(opened->id.get(), H5T_NATIVE_DOUBLE, &value), where);
  return value;
}

}  // namespace q3d::loaders::formats
